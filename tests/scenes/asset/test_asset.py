"""An asset from Python: what it holds, what it is written as, and when its columns are read."""

from pathlib import Path

import numpy as np
import pytest

import obscurance
from obscurance.raytrace import Mesh
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.scenes.asset.asset import Asset, Node
from obscurance.scenes.asset.primitive import NORMAL, Column, ColumnSet, Primitive, W

SEAMLESS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nvt 0 0\nvt .5 0\nvt 1 .25\nf 1/1 2/2 3/3\nf 1/1 3/3 4/2\n"
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


def turned(matrix, **columns):
    """A pentagon's worth of corners, a quadrilateral and a triangle, as they are and as a node places them."""
    primitive = Primitive.of(SQUARE, np.array([0, 1, 2, 3, 0, 2, 3]), np.array([4, 3]), columns=ColumnSet(columns))
    return Asset(Path("m"), (primitive,), (Node("a", (0,)), Node("b", (0,), matrix)))


def test_a_baked_file_is_saved_with_its_w_in_other_formats(tmp_path):
    (tmp_path / "m.obj").write_text(SEAMLESS)
    bake = obscurance.bake(tmp_path / "m.obj", samples=8)
    asset = obscurance.load(tmp_path / "m.obj")
    with pytest.raises(OptionError, match=r"expected w in .*m\.obj, or a bake, got none"):
        asset.save(tmp_path / "none.ply")
    asset.save(tmp_path / "w.ply", bake)
    baked = obscurance.load(tmp_path / "w.ply")
    assert (baked.objects, len(baked.w)) == (("w",), len(asset.mesh.vertices))
    for ending in ("glb", "vtp", "obj"):
        baked.save(tmp_path / f"w.{ending}")
        again = obscurance.load(tmp_path / f"w.{ending}")
        if ending != "obj":
            np.testing.assert_array_equal(again.w[: len(baked.w)], baked.w)
        np.testing.assert_array_equal(again.uv, baked.uv) if ending != "vtp" else None
    obscurance.write(tmp_path / "v.ply", baked, colors="rgb")
    np.testing.assert_array_equal(obscurance.load(tmp_path / "v.ply").w, baked.w)


def test_a_mirrored_place_turns_polygons_and_what_stands_at_their_corners():
    corners = np.arange(7.0)[:, None] * [1, 2]
    asset = turned(
        np.diag([-1.0, 1, 1, 1]), uv0=Column(corners, np.arange(7)), normal=Column(np.tile([3.0, 0, 4], (4, 1)))
    )
    assert asset.corners.tolist() == [0, 1, 2, 3, 0, 2, 3, 7, 6, 5, 4, 7, 6, 4]
    mesh = asset.mesh
    np.testing.assert_array_equal(mesh.faces[3:], mesh.faces[:3, ::-1] + 4)
    np.testing.assert_array_equal(asset.uv[3:], asset.uv[:3, ::-1])
    np.testing.assert_array_equal(mesh.normals[4:], mesh.normals[:4] * [-1, 1, 1])
    area = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
    assert (area[:, 2] > 0).all()
    assert mesh.polygons.tolist() == [0, 0, 1, 2, 2, 3]


def test_a_part_without_a_column_has_nan_and_no_w_is_made_of_half():
    one = Primitive.of(
        SQUARE, np.array([0, 1, 2]), columns=ColumnSet({W: Column(np.ones(4)), "uv0": Column(SQUARE[:, :2])})
    )
    other = Primitive.of(SQUARE, np.array([0, 2, 3]))
    asset = Asset.of(Mesh(SQUARE, [[0, 1, 2]]))
    both = type(asset)(asset.path, (one, other), (Node("a", (0,)), Node("b", (1,))))
    assert both.w is None
    assert np.isfinite(both.uv[0]).all()
    assert np.isnan(both.uv[1]).all()
    assert [run.object.name for run in both.runs()] == ["a", "b"]


def test_columns_are_read_when_they_are_asked_for_and_once():
    calls = []

    def malformed():
        calls.append("uv0")
        raise MeshError("m", "TEXCOORD_0", "two numbers a vertex", "one")

    def normal():
        calls.append(NORMAL)
        return Column(SQUARE)

    asset = turned(None, uv0=malformed, normal=normal)
    assert "uv0" in asset.primitives[0].columns
    assert asset.mesh.normals.shape == (8, 3)
    assert calls == [NORMAL]
    with pytest.raises(MeshError, match="TEXCOORD_0"):
        _ = asset.uv
