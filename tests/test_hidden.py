"""Vertices inside solids: found, told, marked in a picture, filled from their neighbours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import process

import ao
from raytrace import Mesh, OptionError
from raytrace.image_input import read_image


@pytest.fixture(scope="module")
def solids() -> Mesh:
    """A ball half sunk into a fine block."""
    block = trimesh.creation.box((4, 4, 1))
    for _ in range(4):
        block = block.subdivide()
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.apply_translation((0.03, 0.02, 0.47))
    both = trimesh.util.concatenate([block, ball])
    return Mesh(both.vertices, both.faces)


def inside(mesh: Mesh) -> np.ndarray:
    """Vertices well within the ball or the block, by their equations."""
    x, y, z = mesh.vertices.T
    in_ball = (x - 0.03) ** 2 + (y - 0.02) ** 2 + (z - 0.47) ** 2 < 0.95**2
    in_block = (np.abs(x) < 1.9) & (np.abs(y) < 1.9) & (np.abs(z) < 0.45)
    return in_ball | in_block


def outside(mesh: Mesh) -> np.ndarray:
    x, y, z = mesh.vertices.T
    off_ball = (x - 0.03) ** 2 + (y - 0.02) ** 2 + (z - 0.47) ** 2 > 1
    off_block = (np.abs(x) > 1.99) | (np.abs(y) > 1.99) | (np.abs(z) > 0.499)
    return off_ball & off_block


def test_both_sides_are_surface_unless_asked(solids: Mesh) -> None:
    baked = ao.bake(solids, ao.Binary(), samples=64)
    assert baked.flagged["hidden"] == 0


def test_what_is_inside_is_found_and_nothing_else(solids: Mesh) -> None:
    plain, baked = (ao.bake(solids, ao.Binary(), samples=64, hidden=policy) for policy in ("ignore", "mark"))
    found = (baked.flags & ao.Flag.HIDDEN) != 0
    assert found[inside(solids)].all()
    assert not found[outside(solids)].any()
    np.testing.assert_array_equal(baked.w, plain.w)


def test_hidden_vertices_take_their_neighbours_values(solids: Mesh) -> None:
    plain, baked = (ao.bake(solids, ao.Binary(), samples=256, hidden=policy) for policy in ("ignore", "fill"))
    found = (baked.flags & ao.Flag.HIDDEN) != 0
    np.testing.assert_array_equal(baked.w[~found], plain.w[~found])
    assert plain.w[found].max() < 0.05
    top = found & (np.abs(solids.vertices[:, 2] - 0.5) < 1e-6)
    assert top.sum() > 20
    assert baked.w[top].min() > 0.3


def test_an_inward_room_sees_fronts_and_an_outward_one_backs() -> None:
    box = trimesh.creation.box().subdivide()
    for faces, expected in ((box.faces[:, ::-1], 0), (box.faces, 0)):
        baked = ao.bake(Mesh(box.vertices, faces), samples=16, hidden="mark")
        assert baked.flagged["hidden"] == expected
    room = trimesh.creation.box((3, 3, 3))
    both = trimesh.util.concatenate([box, room])
    assert ao.bake(Mesh(both.vertices, both.faces), samples=16, hidden="mark").flagged["hidden"] == len(box.vertices)


def test_a_part_with_nothing_in_sight_keeps_its_values() -> None:
    box, room = trimesh.creation.box(), trimesh.creation.box((3, 3, 3))
    both = trimesh.util.concatenate([box, room])
    marked, filled = (
        ao.bake(Mesh(both.vertices, both.faces), ao.Binary(), samples=16, hidden=policy) for policy in ("mark", "fill")
    )
    np.testing.assert_array_equal(marked.w, filled.w)


def test_threads_change_nothing(solids: Mesh) -> None:
    one, three = (ao.bake(solids, samples=16, hidden="fill", threads=k) for k in (1, 3))
    assert one.w.tobytes() == three.w.tobytes()
    assert one.flags.tobytes() == three.flags.tobytes()


def test_an_unknown_policy_is_a_mistake(solids: Mesh) -> None:
    with pytest.raises(OptionError, match="hidden"):
        ao.bake(solids, hidden="perhaps")  # type: ignore[arg-type]


def test_the_command_reports_and_marks_them(solids: Mesh, tmp_path: Path) -> None:
    trimesh.Trimesh(solids.vertices, solids.faces, process=False).export(tmp_path / "solids.ply")
    done = process(
        "bake", "solids.ply", "-o", "w.npy", "--samples", "16", "--hidden", "fill",
        "--report", "r.json", "--debug-image", "marked.png", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads((tmp_path / "r.json").read_text())
    assert told["flagged"]["hidden"] == len(told["flagged_vertices"]["hidden"]) > 100
    picture = read_image(tmp_path / "marked.png")[0]["beauty"]
    magenta = (picture[..., 0] > 0.9) & (picture[..., 1] < 0.05) & (picture[..., 2] > 0.5)
    assert magenta.sum() > 1000


def test_a_debug_image_must_be_a_picture(tmp_path: Path) -> None:
    done = process("bake", "none.ply", "-o", "w.npy", "--debug-image", "marked.txt", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
