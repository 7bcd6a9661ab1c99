"""Bakes through the backs of faces: single-sided walls, against form factors and closed forms."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from leaf_cards import FLOOR, FLOOR_FACES, HALVES, HEIGHT, SQUARE, form_factors

from obscurance import ao
from obscurance.ao import closed_forms as analytic
from obscurance.ao.options import Options
from obscurance.ao.prepared import Prepared
from obscurance.raytrace import AlphaSurface, Mesh, Opacity
from obscurance.scenes.geometry.polyhedra import icosphere, join, patches

pytestmark = pytest.mark.usefixtures("w_alone")

THROUGH = {"denoise": False, "back_faces": "ignore"}
TAU = 1.5


def over_floor(*squares, alpha=None):
    """A floor under squares of height, half side and whether they look down at it. Args: alpha: of the squares."""
    parts = [(FLOOR, FLOOR_FACES)]
    for height, half, down in squares:
        corners = np.column_stack([2 * half * SQUARE, np.full(4, height)])
        parts.append((corners, HALVES[:, ::-1] if down else HALVES))
    vertices, faces = join(parts)
    opacity = alpha and Opacity(np.arange(len(faces)) // len(FLOOR_FACES) - 1, (AlphaSurface(alpha),))
    return Mesh(vertices, faces, opacity=opacity)


def floor_w(mesh, falloff="binary", samples=2048, **options):
    return ao.bake(mesh, falloff, samples, **(THROUGH | options)).w[: len(FLOOR)]


@pytest.mark.parametrize("falloff", ["binary", "exponential"])
def test_a_wall_seen_from_behind_is_not_there(falloff):
    behind, front = over_floor((HEIGHT, 0.5, False)), over_floor((HEIGHT, 0.5, True))
    assert (floor_w(behind, falloff) == 1).all()
    seen, both = (floor_w(front, falloff, back_faces=each) for each in ("ignore", "occlude"))
    assert np.allclose(seen, both, atol=1e-6)
    if falloff == "binary":
        assert np.allclose(seen, 1 - form_factors(), atol=0.012)


@pytest.mark.parametrize("alpha", [None, 0.3])
def test_a_ray_goes_on_to_what_is_behind(alpha):
    mesh = over_floor((0.2, 0.9, False), (0.3, 0.9, False), (HEIGHT, 0.5, True), alpha=alpha)
    assert np.allclose(floor_w(mesh), 1 - (alpha or 1) * form_factors(), atol=0.012)


def test_inside_a_sphere():
    """Eight patches about the centre of a sphere whose faces look inwards, then outwards."""
    ball, radius = icosphere(4), 0.8
    floor = patches(0.001 * np.random.default_rng(2).normal(size=(8, 3)) * [1, 1, 0], 0.001)
    w = []
    for faces in (ball[1][:, ::-1], ball[1]):
        mesh = Mesh(*join([floor, (radius * ball[0], faces)]))
        options = THROUGH | {"interior": "ignore"}
        w.append(ao.bake(mesh, ao.Exponential(tau=TAU), 256, **options).w[: len(floor[0])])
    assert np.allclose(w[0], analytic.dome(radius, TAU), atol=0.004)
    assert (w[1] == 1).all()


def test_a_profile():
    mesh = over_floor((0.2, 0.9, False), (HEIGHT, 0.5, True))
    baked = ao.bake(mesh, ao.Exponential(tau=TAU), back_faces="ignore", profile=True)
    alone = ao.bake(over_floor((HEIGHT, 0.5, True)), ao.Exponential(tau=TAU), 2048)
    assert np.allclose(baked.w[: len(FLOOR)], alone.w[: len(FLOOR)], atol=0.03)


def test_points_of_a_cloud_have_their_fronts_where_their_normals_point():
    """Of a sheet over another, both by points: it is met from the side that it looks to."""
    steps = np.linspace(-1, 1, 30)
    sheet = np.stack([*np.meshgrid(steps, steps), np.zeros((30, 30))], axis=-1).reshape(-1, 3)
    below = (abs(sheet) < 0.2).all(axis=1)
    for side, options in ((1, {}), (1, THROUGH), (-1, THROUGH)):
        normals = np.repeat([[0, 0, 1.0], [0, 0, side]], len(sheet), axis=0)
        points = np.concatenate([sheet, sheet + np.array([0, 0, 0.2])])
        baked = ao.bake_points(None, points, normals, falloff="binary", samples=64, **options)
        w = baked.w[: len(sheet)][below].mean()
        assert w == 1 if side > 0 and options else w < 0.2


def test_backs_mark_what_is_inside_solids_all_the_same():
    vertices, faces = icosphere(2)
    mesh = Mesh(*join([(vertices, faces), (vertices + np.array([0.9, 0, 0]), faces)]))
    for interior in ("auto", "mark"):
        options = {"samples": 16, "interior": interior}
        seen, through = (ao.bake(mesh, back_faces=each, **options) for each in ("occlude", "ignore"))
        assert np.array_equal(seen.flags, through.flags)
        assert through.flagged["hidden"] > 0


def test_other_processes_let_rays_through():
    mesh = over_floor((HEIGHT, 0.5, False))
    for each, alpha in ((mesh, None), (replace(mesh, opacity=Opacity([0] * len(mesh.faces), [AlphaSurface(0.5)])), 0)):
        scene = Prepared.of(each, Options(back_faces="ignore"), None, None).scene
        assert pickle.loads(pickle.dumps(scene)).opacity.one_sided == 1
        assert (scene.opacity.of == (-1 if alpha is None else 0)).all()
    assert Prepared.of(mesh, Options(), None, None).scene.opacity is None


@pytest.mark.parametrize("falloff", ["binary", "exponential"])
@pytest.mark.parametrize("alpha", [None, 0.3])
def test_the_surface_method(falloff, alpha):
    options = {"samples": 1 << 14, "method": "surface", "back_faces": "ignore"}
    squares = (0.2, 0.9, False), (0.3, 0.9, False), (HEIGHT, 0.5, True)
    both, alone, behind = (
        ao.bake(over_floor(*some, alpha=alpha), falloff, **options).w[: len(FLOOR)]
        for some in (squares, squares[2:], squares[:2])
    )
    assert (behind == 1).all()
    assert np.allclose(both, alone, atol=0.02)
    seen = ao.bake(over_floor(squares[2], alpha=alpha), falloff, samples=1 << 14, method="surface").w[: len(FLOOR)]
    assert np.allclose(alone, seen, atol=0.02)
    assert alone.min() < (0.7 if alpha is None else 0.9)


def test_by_the_surface_method_too_backs_mark_what_is_inside():
    vertices, faces = icosphere(2)
    mesh = Mesh(*join([(vertices, faces), (vertices + np.array([0.9, 0, 0]), faces)]))
    seen, through = (
        ao.bake(mesh, samples=64, method="surface", interior="mark", back_faces=each) for each in ("occlude", "ignore")
    )
    assert np.array_equal(seen.flags, through.flags)
    assert seen.flagged["hidden"] > 20
