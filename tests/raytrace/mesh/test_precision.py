"""Precision that a mesh lacks is reported: in Python, on standard error, in the report and by `info`."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from command import obscurance, succeeded
from stress.pose import Pose
from stress.solids import grid

from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.warnings import TILT, coarseness, precision_warnings
from obscurance.scenes.geometry.polyhedra import icosphere, join


def test_a_mesh_far_from_the_origin_is_reported_by_how_it_is_stored():
    part = icosphere(4)
    assert precision_warnings(Pose(1.0, 1e5, 1).mesh(part)) == []
    (text,) = precision_warnings(Pose(1.0, 1e5, 1, single=True).mesh(part, "far.ply"))
    assert text.startswith("far.ply: normals of 2,562 of 2,562 vertices are uncertain by")
    assert "as stored have steps of 0.0078" in text


def test_a_detail_too_small_for_the_whole_is_reported():
    part = icosphere(3)
    for size, expected in ((1e-3, 0), (1e-7, len(part[0]))):
        found = coarseness(Mesh(*join([icosphere(4), (size * part[0] + 0.7, part[1])])))
        assert found.vertices == expected
        assert not found.stored


def test_a_detail_that_is_most_of_a_mesh_is_not_too_small():
    vertices, faces = icosphere(3)
    floor = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]])
    assert coarseness(Mesh(*join([floor, (1e-7 * vertices + 0.4, faces)]))).vertices == 0


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_the_figure_is_the_tilt_that_rounding_makes(scale):
    """Normals of a sphere rounded to float32, against those it had: the median is predicted within a factor of 5."""
    part = icosphere(4)
    exact = Pose(scale, 3e4, 1).mesh(part)
    rounded = Pose(scale, 3e4, 1, single=True).mesh(part)
    a, b = (
        trimesh.Trimesh((m.vertices - exact.centre) / scale, m.faces, process=False).vertex_normals
        for m in (exact, rounded)
    )
    actual = np.median(np.linalg.norm(np.cross(a, b), axis=1))
    found = coarseness(rounded)
    assert found.tilt > TILT
    assert 0.2 * found.tilt < actual < found.tilt


def test_whole_numbers_far_away_are_exact():
    """They are float32 numbers, but nothing was rounded to them."""
    vertices, faces = grid(8, 8.0)
    assert precision_warnings(Mesh(vertices + 1e6, faces)) == []
    assert precision_warnings(Mesh(Pose(turn=1).vertices(vertices).astype(np.float32) + np.float32(1e6), faces)) != []


def test_faces_without_area_are_not_its_business():
    assert (
        precision_warnings(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], [[0, 1, 2], [0, 1, 3], [1, 1, 1]])) == []
    )


def test_the_command_says_so(tmp_path):
    far, near = tmp_path / "far.ply", tmp_path / "near.ply"
    part = icosphere(2)
    for path, offset in ((far, 1e5), (near, 0.0)):
        trimesh.Trimesh(Pose(1.0, offset, 1).vertices(part[0]), part[1], process=False).export(path)
    for path, count in ((far, 1), (near, 0)):
        report = tmp_path / "report.json"
        done = succeeded("bake", path, "-o", tmp_path / "w.npy", "--samples", 8, "--report", report)
        printed = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(printed) == count
        warnings = json.loads(report.read_text())["warnings"]
        assert [f"warning: {text}" for text in warnings] == printed
        assert obscurance("info", path).stdout.count("\nwarning") == count


def test_so_does_that_for_pictures_once_for_each_mesh(tmp_path):
    part = icosphere(2)
    for name, offset in (("far", 1e5), ("near", 0.0)):
        made = trimesh.Trimesh(Pose(1.0, offset, 1).vertices(part[0]), part[1], process=False)
        made.export(tmp_path / f"{name}.ply")
    objects = [f'[[objects]]\nmesh = "{name}.ply"\n' for name in ("far", "far", "near")]
    (tmp_path / "scene.toml").write_text("\n".join(objects))
    for scene, count in (("scene.toml", 1), ("far.ply", 1), ("near.ply", 0)):
        report = tmp_path / "report.json"
        size = "--width", 8, "--height", 8, "--samples", 1, "--obscurance", "off"
        done = succeeded("render", tmp_path / scene, "-o", tmp_path / "p.png", *size, "--report", report)
        printed = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(printed) == count, done.stderr
        assert [f"warning: {text}" for text in json.loads(report.read_text())["warnings"]] == printed


def test_what_float32_cannot_hold_overflows_nowhere():
    vertices = np.random.default_rng(0).normal(size=(300, 3))
    vertices[-1] = 1e60
    (warning,) = precision_warnings(Mesh(vertices, np.arange(300).reshape(-1, 3)))
    assert "float32 coordinates from the centre of the mesh have steps of" in warning


@pytest.mark.parametrize("away", [0.0, 3.0, 1e3, 1e5, 1e6])
def test_the_short_cut_leaves_out_nothing(monkeypatch, away):
    ball = trimesh.creation.icosphere(subdivisions=4)
    mesh = Mesh((ball.vertices + away).astype(np.float32), ball.faces)
    short = coarseness(mesh)
    monkeypatch.setattr("obscurance.raytrace.mesh.warnings._may_tilt", lambda _: True)
    assert coarseness(mesh) == short
    assert (short.vertices > 0) == (away >= 1e5)
