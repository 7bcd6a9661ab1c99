"""Thickness: rays inwards, against closed forms of balls, slabs and boxes, at vertices and texels."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mesh_files import obj
from meshes import grid

from obscurance import ao
from obscurance.ao import closed_forms as analytic
from obscurance.ao.result import Interpolation
from obscurance.raytrace import AlphaSurface, Mesh, Opacity
from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake
from obscurance.scenes.bake.run import run
from obscurance.scenes.geometry.polyhedra import icosphere, join

FALLOFFS = {
    "binary": (ao.Binary(0.7), None, 0.7),
    "exponential": (ao.Exponential(tau=1.5), 1.5, np.inf),
    "limited": (ao.Exponential(tau=1.5, max_distance=0.8), 1.5, 0.8),
    "linear": (ao.Linear(0.9), "linear", 0.9),
    "smooth": (ao.Smooth(0.9), "smooth", 0.9),
}
EXPONENTIAL = {"falloff": ao.Exponential(tau=1.5), "thickness": True}


def box(*sides, steps=4):
    """A box about the origin whose faces are grids of steps² cells, vertices of each face its own."""
    parts, (flat, faces) = [], grid(steps)
    for axis in range(3):
        for side in (-0.5, 0.5):
            corners = np.roll(np.add(flat, [0, 0, side]), axis + 1, axis=1) * sides
            parts.append((corners, faces if side > 0 else faces[:, ::-1]))
    return Mesh(*join(parts))


def exact_in_box(points, sides, rate):
    """w at points on the lower face of a box of z from −½ to ½, seen from inside."""
    x, y, height = np.array(sides) / 2 * [1, 1, 2]
    return np.array([analytic.box((x - p[0], y - p[1], x + p[0], y + p[1]), height, rate) for p in points])


@pytest.mark.parametrize("tau", [0.7, 3.0])
def test_a_ball_at_every_vertex(tau):
    vertices, faces = icosphere(4)
    baked = ao.bake(Mesh(vertices, faces), ao.Exponential(tau=tau), 256, thickness=True)
    assert np.abs(baked.w - analytic.inside_sphere(1.0, tau)).max() < 0.01
    assert (np.einsum("ij,ij->i", baked.bent_normals, vertices) < -0.9).all()
    assert not baked.shortfalls
    assert not baked.flags.any()
    assert (ao.bake(Mesh(vertices, faces), "binary", 16, thickness=True).w == 0).all()


@pytest.mark.parametrize("falloff", FALLOFFS)
def test_a_slab(falloff):
    form, rate, limit = FALLOFFS[falloff]
    mesh = box(80, 80, 0.4)
    middle = (np.abs(mesh.vertices[:, :2]) < 25).all(axis=1)
    w = ao.bake(mesh, form, 1024, thickness=True, denoise=False).w[middle]
    assert len(w) == 18
    assert np.allclose(w, analytic.ceiling(0.4, rate, limit), atol=0.003)


@pytest.mark.parametrize("options", [{"tolerance": 0.005}, {"profile": True}, {}])
def test_a_box(options):
    sides = 2.0, 3.0, 0.5
    mesh = box(*sides)
    baked = ao.bake(mesh, **EXPONENTIAL | options)
    inner = (mesh.vertices[:, 2] == -0.25) & (np.abs(mesh.vertices[:, :2]) < 0.9 * np.array(sides[:2]) / 2).all(axis=1)
    assert np.allclose(baked.w[inner], exact_in_box(mesh.vertices[inner], sides, 1.5), atol=0.012)
    assert not baked.shortfalls
    measured = baked.interpolation
    again = np.einsum("ki,ki->k", measured.weights, baked.w[mesh.faces[measured.faces]])
    again = Interpolation.of(*measured[2:5], again, np.zeros(len(again)))
    assert abs(again.rmse - measured.rmse) < 0.002


def test_textures():
    sides = 2.0, 3.0, 0.5
    mesh = box(*sides)
    lower = (mesh.vertices[:, 2] == -0.25) & (np.arange(len(mesh.vertices)) // 25 == 4)
    uv = np.where(lower[:, None], mesh.vertices[:, :2] / sides[:2] + 0.5, np.nan)
    baked = ao.bake_texture(mesh, uv, 12, samples=1024, denoise=False, **EXPONENTIAL)
    place = (np.arange(12) + 0.5) / 12 - 0.5
    points = np.stack(np.meshgrid(place, place[::-1]), axis=-1) * sides[:2]
    inner = slice(2, -2), slice(2, -2)  # elsewhere the mean over a texel is not w at its centre
    exact = exact_in_box(points[inner].reshape(-1, 2), sides, 1.5)
    assert np.abs(baked.w[inner].ravel() - exact).max() < 0.006
    assert baked.facts.mirrored == 32  # as the lower side of the box has x to the right
    assert np.array_equal(np.nan_to_num(baked.uv, nan=-1), np.nan_to_num(uv[mesh.faces], nan=-1))
    coarse = box(*sides, steps=1)
    uv = np.where(np.arange(24)[:, None] // 4 == 4, coarse.vertices[:, :2] / sides[:2] + 0.5, np.nan)
    fine = ao.bake_texture(coarse, uv, 12, high=mesh, samples=1024, denoise=False, **EXPONENTIAL)
    assert np.abs(fine.w[inner].ravel() - exact).max() < 0.006


def test_of_a_finer_mesh():
    ball, coarse = Mesh(*icosphere(4)), Mesh(*icosphere(2))
    w = ao.bake(coarse, high=ball, samples=256, **EXPONENTIAL).w
    assert np.allclose(w, analytic.inside_sphere(1.0, 1.5), atol=0.01)


def test_fitted_to_the_surface():
    baked = ao.bake(Mesh(*icosphere(3)), method="surface", **EXPONENTIAL)
    assert np.allclose(baked.w, analytic.inside_sphere(1.0, 1.5), atol=0.012)
    assert (baked.bent_normals * baked.mesh.vertices).sum(axis=1).max() < -0.9


def test_it_is_the_openness_of_the_mesh_turned_over():
    vertices, faces = icosphere(2)
    opacity = Opacity(np.arange(len(faces)) % 2 - 1, (AlphaSurface(0.3),), corners=np.ones((len(faces), 3)))
    mesh = Mesh(vertices * [1, 0.6, 0.3], faces, vertices, opacity=opacity)
    over = Mesh(mesh.vertices, faces[:, ::-1], -vertices, opacity=opacity)
    for normals in ("angle", "file"):
        one, other = (
            ao.bake(each, samples=32, normals=normals, thickness=each is mesh, back_faces="ignore", spread=120)
            for each in (mesh, over)
        )
        assert np.array_equal(one.w, other.w)
    assert one.w.std() > 0.02
    again = ao.bake(ao.prepare(mesh), samples=32, normals="file", thickness=True, back_faces="ignore", spread=120)
    assert np.array_equal(again.w, one.w)


def test_holes_are_told():
    mesh = box(1, 1, 1, steps=1)
    assert not ao.bake(mesh, samples=16, thickness=True).shortfalls  # though each face has vertices of its own
    cup = replace(mesh, faces=mesh.faces[2:], source="cup.obj")
    said = (
        "cup.obj: 4 edges are open: where rays leave through holes, the mesh counts as thick; "
        "close them, or limit the distance"
    )
    assert ao.bake(cup, samples=16, thickness=True).shortfalls == (said,)
    assert not ao.bake(cup, samples=16).shortfalls
    uv = np.tile([[0, 0], [0, 1], [1, 0], [1, 1]], (6, 1))
    assert ao.bake_texture(cup, uv, 4, samples=16, thickness=True).shortfalls == (said,)


def test_thickness_is_no_occlusion_of_a_glb_unless_asked(tmp_path):
    for given, expected in (({"thickness": False}, None), ({}, "none"), ({"occlusion": "ramp"}, "ramp")):
        files = {"mesh": [tmp_path / "ball.obj"], "output": tmp_path / "ball.glb"}
        assert plan_bake(BakeOptions(**(files | {"thickness": True} | given))).options.occlusion == expected


def test_a_thin_mesh_is_not_taken_for_one_inside_out(tmp_path):
    vertices, faces = icosphere(2)
    mesh, report = tmp_path / "ball.obj", tmp_path / "report.json"
    mesh.write_bytes(obj(vertices, faces))
    options = {"thickness": True, "falloff": "binary", "samples": 16, "quiet": True, "report": report}
    list(run(plan_bake(BakeOptions(mesh=[mesh], output=tmp_path / "w.npy", **options))))
    found = json.loads(report.read_text())
    assert found["w"]["most"] == 0
    assert "inside out" not in json.dumps(found["verdict"])
