"""Several falloffs, and profiles, from one set of rays: each column is what its own bake gives."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from leaf_cards import FLOOR, FLOOR_FACES, HALVES, SQUARE
from meshes import crumpled, hills, two_boxes
from uv_meshes import grid_charts

from obscurance import ao
from obscurance.ao.report import report
from obscurance.raytrace import AlphaSurface, Mesh, Opacity, OptionError
from obscurance.scenes.validation.curved import curved_cases
from obscurance.scenes.validation.flat import flat_cases

pytestmark = pytest.mark.usefixtures("w_alone")

FALLOFFS = [
    "exponential", ao.Exponential(half_distance="40%"), ao.Exponential(half_distance="20%"), ao.Smooth("60%"),
    ao.Exponential(half_distance="10%", max_distance="30%"), ao.Binary(), ao.Binary("25%"), ao.Linear("50%"),
    ao.Tabulated([0, 0.1, 0.6], [0, 0.7, 1]),
]  # fmt: skip
HILLS, FOLDED, BOXES = Mesh(*hills(16)), Mesh(*crumpled(hills(12), 0.5, 1)), Mesh(*two_boxes())
CHARTS = Mesh(*hills(12))


@pytest.mark.parametrize("options", [
    {"samples": 64, "denoise": False}, {"samples": 32},
], ids=str)  # fmt: skip
@pytest.mark.parametrize("mesh", [FOLDED, BOXES], ids=["folded", "partly inside"])
def test_each_column_is_the_bake_of_its_falloff_alone(mesh, options):
    check_columns(partial(ao.bake, mesh, **options))


def test_columns_of_some_vertices_and_of_a_fine_mesh():
    check_columns(partial(ao.bake, FOLDED, samples=16, only=np.arange(144) % 3 == 0))
    check_columns(partial(ao.bake, Mesh(*hills(12)), high=HILLS, cage="10%", samples=16))


def test_a_tolerance_holds_for_each_column_by_rays_that_they_share():
    mesh, tolerance = Mesh(*hills(40)), 0.01
    bake = partial(ao.bake, mesh, seed=1)
    baked = bake(FALLOFFS, tolerance=tolerance)
    exact = bake(FALLOFFS, samples=4096, denoise=False)
    errors = np.sqrt(np.mean((baked.values - exact.values) ** 2, axis=0))
    assert (errors < 1.1 * tolerance).all()
    assert (np.array(baked.rmses) <= tolerance).all()
    assert np.sqrt(np.mean(baked.errors**2, axis=0)) == pytest.approx(baked.rmses)
    assert baked.rays < 1.5 * max(bake(falloff, tolerance=tolerance).rays for falloff in FALLOFFS)


def check_columns(bake):
    baked = bake(FALLOFFS)
    assert baked.values.shape == baked.errors.shape == (len(baked.mesh.vertices), len(FALLOFFS))
    for column, falloff in enumerate(FALLOFFS):
        alone = bake(falloff)
        np.testing.assert_allclose(baked.values[:, column], alone.w, rtol=0, atol=1e-6)
        np.testing.assert_allclose(baked.errors[:, column], alone.error, rtol=0, atol=1e-6)
        assert baked.rmses[column] == pytest.approx(alone.rmse, abs=1e-6)


def test_columns_of_rays_that_pass_alpha():
    vertices = np.concatenate([FLOOR, *(np.column_stack([SQUARE, np.full(4, h)]) for h in (0.3, 0.7))])
    faces = np.concatenate([FLOOR_FACES, HALVES + len(FLOOR), HALVES + len(FLOOR) + 4])
    of = np.repeat([-1, 0, 1], [len(FLOOR_FACES), 2, 2])
    opacity = Opacity(of, (AlphaSurface(0.5), AlphaSurface(0.8)), np.zeros((len(faces), 3, 2)))
    check_columns(partial(ao.bake, Mesh(vertices, faces, opacity=opacity), samples=64, denoise=False))


def test_columns_of_textures():
    bake = partial(ao.bake_texture, CHARTS, grid_charts(len(CHARTS.faces)), 48, samples=32, close_seams=False)
    baked = bake(FALLOFFS[:4], profile=True)
    for column, falloff in enumerate(FALLOFFS[:4]):
        alone = bake(falloff)
        np.testing.assert_allclose(baked.values[..., column], alone.w, rtol=0, atol=1e-6)
        assert baked.rmses[column] == pytest.approx(alone.rmse, rel=0.3)  # at probes where any of them errs most
    alone = bake(ao.Exponential(half_distance="4%"))
    np.testing.assert_allclose(baked.profile.values[..., 3], alone.w, rtol=0, atol=1e-6)


@pytest.mark.parametrize("denoise", [True, False])
def test_a_profile_stands_beside_w_which_stays_as_it_is(denoise):
    options = {"samples": 64, "denoise": denoise}
    baked, plain = ao.bake(HILLS, "binary", profile=True, **options), ao.bake(HILLS, "binary", **options)
    np.testing.assert_array_equal(baked.w, plain.w)
    np.testing.assert_array_equal(baked.error, plain.error)
    np.testing.assert_allclose(baked.profile.half_distances, 0.005 * HILLS.radius * 2.0 ** np.arange(10))
    assert baked.profile.radius == pytest.approx(HILLS.radius)
    for column in (0, 4, 9):
        alone = ao.bake(HILLS, ao.Exponential(half_distance=f"{0.5 * 2**column}%"), **options)
        np.testing.assert_allclose(baked.profile.values[:, column], alone.w, rtol=0, atol=1e-6)
        np.testing.assert_allclose(baked.profile_errors[:, column], alone.error, rtol=0, atol=1e-6)
    described = report(baked, {"seed": 0}, {})["profile"]
    assert described["half_distances"] == baked.profile.half_distances.tolist()
    assert described["rmse"] == pytest.approx(np.sqrt(np.mean(baked.profile_errors**2, axis=0)))
    assert plain.profile is None
    assert "profile" not in report(plain, {"seed": 0}, {})
    assert plain.values.shape == (len(HILLS.vertices), 1)


def test_to_a_tolerance_a_profile_takes_the_rays_of_w():
    bake = partial(ao.bake, HILLS, ao.Exponential(half_distance="5%"), tolerance=0.02)
    baked, plain = bake(profile=True), bake()
    assert baked.rays == plain.rays
    np.testing.assert_array_equal(baked.w, plain.w)
    np.testing.assert_array_equal(baked.error, plain.error)
    assert max(baked.rmses[1:]) > 0.02
    assert not baked.shortfalls  # the tolerance is that of w
    truth = ao.bake(HILLS, ao.Exponential(half_distance="256%"), samples=4096, denoise=False).w
    assert 1 / 1.5 < baked.rmses[-1] / np.sqrt(np.mean((baked.profile.values[:, -1] - truth) ** 2)) < 1.5


CASES = {each.name: each for each in (*flat_cases(), *curved_cases())}


@pytest.mark.parametrize("name", ["wall", "ceiling", "closed box", "inside a sphere"])
def test_octaves_of_closed_forms(name):
    octaves = tuple(ao.Exponential(half_distance=0.02 * 2.0**k) for k in range(10))
    case = replace(CASES[name], falloffs=octaves)
    baked = ao.bake(case.mesh, octaves, samples=4096, denoise=False, normals=case.normals,
                    only=np.isin(np.arange(len(case.mesh.vertices)), case.points))  # fmt: skip
    for column, expected in enumerate(case.configurations()):
        error = np.abs(baked.values[case.points, column] - expected.exact).max()
        assert error <= expected.allowed(), f"half-distance {math.log(2) / octaves[column].resolve(1).tau:.3g}"


@pytest.mark.parametrize(("options", "said"), [
    ({"falloff": []}, "falloff: expected a falloff or a list of falloffs, got an empty list"),
    ({"falloff": ["binary", 3]}, "falloff: expected ao.Binary"),
    ({"falloff": 3}, "falloff: expected ao.Binary"),
    ({"profile": "yes"}, "profile: expected"),
])  # fmt: skip
def test_what_does_not_go_together_is_refused_in_one_line(options, said):
    with pytest.raises(OptionError, match=said.replace("(", r"\(")) as fault:
        ao.bake(HILLS, **options)
    assert "\n" not in str(fault.value)
