"""The validation table as a test, its statistics, and proof that it can fail."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import isinf, nan, pi

import numpy as np
import pytest
from ray_starts import change_origins, scaled_offsets
from shared_directions import only_w, prepared

from obscurance import ao
from obscurance.ao.falloff import Binary, Exponential, Linear, Smooth
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import icosphere, inscribed_radius, prism
from obscurance.scenes.validation import table as validation
from obscurance.scenes.validation.configurations import Configuration

LINES = validation.configurations()
POLYGONS = [line for line in LINES if line.name.startswith("polygon")]
SEEDS = 20


def label(line: Configuration) -> str:
    return f"{line.name}, {validation.described(line.falloff)}"


def test_matches_the_closed_forms() -> None:
    with only_w():
        found = validation.run_validation()
    assert len(found) == len(LINES)
    assert [result for result in found if not result.ok or abs(result.error) > result.allowed] == []


@pytest.mark.parametrize("line", LINES[::3], ids=label)
def test_a_bake_to_a_tolerance_matches_the_closed_form(line: Configuration) -> None:
    """Root mean square over the mesh; single vertices may be off by more."""
    with only_w():
        only = None if line.mesh.normals is None else ~np.isnan(line.mesh.normals).any(axis=1)
        baked = ao.bake(line.mesh, line.falloff, tolerance=0.002, only=only, **line.options)
    error = np.abs(baked.w[line.points] - line.exact)
    assert error.max() <= 4 * 0.002 + line.truncation + line.tessellation
    assert np.sqrt(np.mean(error**2)) <= 2 * 0.002 + line.truncation + line.tessellation


@pytest.mark.parametrize(("samples", "lines"), [(1, LINES[::2]), (100, LINES[1::2])])
def test_what_is_allowed_goes_by_the_number_of_rays(samples: int, lines: list[Configuration]) -> None:
    with only_w():
        found = validation.run_validation(samples=samples, lines=prepared(lines))
    assert [result for result in found if not result.ok] == []
    tight = [abs(result.error) / result.allowed for result in found if result.line.target > 1e-6]
    assert max(tight) > 0.25


def test_more_rays_are_allowed_less() -> None:
    for line in LINES:
        if line.target > 1e-6:
            allowed = [line.allowed(samples) for samples in (100, 4096, 16384, 1 << 20)]
            assert allowed == sorted(allowed, reverse=True)
            assert allowed[1] == line.allowed() > allowed[2]
            assert line.allowed(1) <= 1 + line.truncation + line.tessellation


def test_a_wrong_estimator_fails_with_few_rays_too(monkeypatch: pytest.MonkeyPatch) -> None:
    other_directions(monkeypatch, lambda u: u)
    with only_w():
        assert sum(not result.ok for result in validation.run_validation(samples=64, lines=prepared(CHEAP))) >= 6


def test_targets_are_not_watered_down() -> None:
    for line in LINES:
        assert line.target <= (0.004 if isinstance(line.falloff, Binary) else 0.001)
        assert line.truncation + line.tessellation <= 6.5e-4
        if line.name.startswith("nothing above"):
            assert line.allowed() == 0.0
        if line.name == "dome":
            assert line.target <= 1e-6
    for name in ("closed unit cube", "inside a sphere", "dome"):
        assert any(line.name == name and line.target == 1e-6 and (line.exact == 0).all() for line in LINES)


def test_every_closed_form_has_a_line() -> None:
    names = " ".join(line.name for line in LINES)
    for name in (
        "nothing above: plane", "nothing above: cube", "nothing above: tetrahedron", "nothing above: icosphere", "dome",
        "ceiling", "coaxial disk", "wall", "infinite wall", "corner of two walls", "V-groove", "trench",
        "sphere above a plane", "inside a sphere", "inside a cylinder", "cylinder parallel to a plane",
        "closed unit cube", "tilted normal", "polygons by Lambert's formula",
        "inverted pyramid of 3 sides", "inverted pyramid of 512 sides",
    ):  # fmt: skip
        assert name in names
    for name in {line.name for line in LINES} - {"tilted normal"}:
        kinds = {type(line.falloff) for line in LINES if line.name == name}
        binary_alone = "olygon" in name or "pyramid" in name
        assert kinds - {Linear, Smooth} == ({Binary} if binary_alone else {Binary, Exponential}), name
    for kind, at_least in (
        (Linear, {"ceiling", "infinite wall", "trench", "closed unit cube", "closed box", "dome", "coaxial disk"}),
        (Smooth, {"ceiling", "infinite wall", "dome", "coaxial disk"}),
    ):
        assert at_least <= {line.name for line in LINES if isinstance(line.falloff, kind)}
    limited = {line.name for line in LINES if not isinf(float(line.falloff.max_distance))}
    assert {"ceiling", "closed unit cube", "coaxial disk", "trench", "infinite wall"} <= limited


def polygon_errors(samples: int, seed: int) -> np.ndarray:
    raw = partial(ao.bake, denoise=False)
    with only_w():
        lines = prepared(POLYGONS)
        return np.concatenate([validation.measure(line, raw, samples, seed) - line.exact for line in lines])


@pytest.mark.parametrize("samples", [2048, 13])
def test_polygons_show_no_bias(samples: int) -> None:
    errors = np.array([polygon_errors(samples, seed) for seed in range(SEEDS)])
    spread = errors.std(axis=0, ddof=1) / np.sqrt(SEEDS)
    assert np.abs(errors[:, spread == 0]).max(initial=0) < 1 / samples  # every scramble has as many hits
    scores = errors.mean(axis=0)[spread > 0] / spread[spread > 0]
    assert len(scores) >= 8
    # Student's t with 19 degrees of freedom: 4.5 is passed by chance once in 4,000 scores
    assert np.abs(scores).max() < 4.5
    assert np.mean(np.square(scores)) < 2.2


@pytest.mark.parametrize("wrong", [nan, 0.0])
def test_a_single_wrong_point_is_a_failure(wrong: float) -> None:
    line = LINES[0]
    measured = np.where(np.arange(len(line.points)) == 3, wrong, line.exact)
    assert not validation.compare(line, measured).ok


def test_the_printed_table_reports_a_failure() -> None:
    *good, line = validation.run_validation(samples=64, lines=LINES[:4])
    bad = replace(line, measured=0.5)
    text = validation.validation_table(good)
    assert text.count("\n") == 4
    assert text.endswith("all 3 within what is allowed")
    assert "FAILED" not in text
    text = validation.validation_table([*good, bad])
    assert text.endswith("1 of 4 failed")
    assert text.splitlines()[-2].endswith("FAILED")


def test_tessellation_bounds_hold() -> None:
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    vertices, faces = icosphere(2)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore"):
        radius = np.abs(np.einsum("ij,ij->i", normal, a)) / np.abs(directions @ normal.T)
    inside = inscribed_radius((vertices, faces))
    assert inside <= radius.min(axis=1).min() < radius.min(axis=1).max() <= 1.0
    assert inscribed_radius(prism(16, 4.0)) == pytest.approx(np.cos(pi / 16))


# Wrong estimators. Each must be distinguished from a right one by several of a few cheap lines.

CHEAP = [
    line
    for line in LINES
    if line.name
    in (
        "nothing above: plane",
        "nothing above: cube from outside",
        "ceiling",
        "trench",
        "closed unit cube",
        "corner of two walls",
    )
] + POLYGONS[:2]


def failures(bake: validation.Baker, lines: Sequence[Configuration] | None = None) -> list[validation.Result]:
    """The cheap lines that fail, or those of `lines`."""
    with only_w():
        return [each for each in validation.run_validation(bake, lines=lines or prepared(CHEAP)) if not each.ok]


def altered(change: Callable[[np.ndarray], np.ndarray]) -> validation.Baker:
    """`ao.bake` with its w passed through `change`."""

    def bake(*args: object, **options: object) -> ao.Bake:
        baked = ao.bake(*args, **options)  # type: ignore[arg-type]
        return replace(baked, w=change(baked.w))

    return bake


def other_directions(monkeypatch: pytest.MonkeyPatch, cosine: Callable[[np.ndarray], np.ndarray]) -> None:
    """Make the baker draw directions whose cosθ is `cosine(u)` for a uniform u."""

    def directions(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        z, azimuth = cosine(u), 2 * np.pi * v
        r = np.sqrt(np.maximum(1 - z * z, 0))
        return np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=-2)

    monkeypatch.setattr("obscurance.ao.rays.directions.cosine_hemisphere", directions)


def test_the_true_estimator_passes_however_it_is_wrapped(monkeypatch: pytest.MonkeyPatch) -> None:
    assert failures(altered(lambda w: w)) == []
    other_directions(monkeypatch, lambda u: np.sqrt(1 - u))
    assert failures(ao.bake) == []


def test_uniform_directions_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    other_directions(monkeypatch, lambda u: u)
    failed = failures(ao.bake)
    assert len(failed) >= 8
    assert {type(result.line.falloff) for result in failed} == {Binary, Exponential, Linear, Smooth}


@pytest.mark.parametrize("factor", [0.5, pi / 3.2], ids=["2π for π", "3.2 for π"])
def test_a_wrong_pi_fails(factor: float) -> None:
    failed = failures(altered(lambda w: factor * w))
    assert len(failed) >= len(CHEAP) - 4  # all but those that are 0


def test_own_triangle_hits_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    change_origins(monkeypatch, **scaled_offsets(0.0))
    failed = failures(ao.bake, CHEAP)  # ray origins are what is prepared
    assert any(result.line.name.startswith("nothing above") for result in failed)


def test_an_ignored_distance_limit_fails() -> None:
    def bake(mesh: Mesh, falloff: ao.Falloff, **options: object) -> ao.Bake:
        return ao.bake(mesh, replace(falloff, max_distance=1000 * float(falloff.max_distance)), **options)

    limited = {label(line) for line in CHEAP if not isinf(float(line.falloff.max_distance))}
    assert len(failures(bake)) == len(limited)
