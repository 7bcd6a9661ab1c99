"""The stability suite as a test, and proof that each of its groups can fail."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from command import obscurance, refused

from raytrace.ray_origins.offset import ray_offset
from scenes.stress import limits, rays
from scenes.stress.contacts import contacts
from scenes.stress.defects import defects
from scenes.stress.line import Line, stress_table
from scenes.stress.pictures import pictures
from scenes.stress.pose import OFFSETS, SCALES, Pose, poses
from scenes.stress.suite import GROUPS, run_stress


def failed(lines) -> list[str]:
    return [f"{line.case}: {line.measured:g} {line.quantity}, {line.undefined} NaN" for line in lines if not line.ok]


@pytest.mark.parametrize("group", GROUPS, ids=[group.__name__ for group in GROUPS])
def test_the_short_form_holds(group) -> None:
    assert failed(group(False, None)) == []


@pytest.mark.slow
def test_the_long_form_holds() -> None:
    assert failed(run_stress(long=True)) == []


def test_long_poses_hold_every_scale_offset_and_a_turn() -> None:
    found = poses(long=True)
    assert {(p.scale, p.offset) for p in found} == {(s, o) for s in SCALES for o in OFFSETS}
    assert {(p.scale, p.turn) for p in found} == {(s, t) for s in SCALES for t in (None, 5, 6)}
    assert min(SCALES) == pytest.approx(1e-9)
    assert max(SCALES) == pytest.approx(1e9)
    assert max(OFFSETS) == 1e8


def test_a_pose_is_a_similarity() -> None:
    points = np.random.default_rng(0).normal(size=(5, 3))
    moved = Pose(1e3, 1e2, 4).vertices(points)
    between = np.linalg.norm(moved - moved[0], axis=1)
    np.testing.assert_allclose(between, 1e3 * np.linalg.norm(points - points[0], axis=1), rtol=1e-9)
    low, high = points.min(axis=0), points.max(axis=0)
    away = np.linalg.norm(Pose(1e3, 1e2, 4).vertices(points, (low + high)[None] / 2))
    assert away == pytest.approx(1e5 * (high - low).max())


def test_rays_that_start_on_the_surface_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytrace.ray_origins.origins.ray_offset", lambda *arguments: 0.0 * ray_offset(*arguments))
    assert len(failed(islice(rays.self_hits(False, None), 3))) >= 2


def test_rays_that_mind_only_their_own_faces_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytrace.ray_origins.origins.turn_directions", lambda *arguments: None)
    edged = {name: rays.closed()[name] for name in ("cube, hard edges", "cube with T-junctions")}
    monkeypatch.setattr(rays, "closed", lambda: edged)
    monkeypatch.setattr(rays, "poses", lambda long: [Pose(turn=4)])
    monkeypatch.setattr(rays, "_SINGLE", [])
    assert len(failed(islice(rays.leaks(False, None), 2))) == 2
    assert len(failed(contacts(False, None))) >= 3


def test_offsets_that_pass_through_a_plate_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytrace.ray_origins.origins.ray_offset", lambda *arguments: 4 * ray_offset(*arguments))
    monkeypatch.setattr("raytrace.ray_origins.origins.stop_short", lambda *arguments: None)
    assert any("face to face" in line.case for line in contacts(False, None) if not line.ok)


def test_a_silent_limit_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "precision_warnings", lambda mesh: [])
    assert len(failed(limits.limits(False, None))) == 5
    monkeypatch.setattr(limits, "precision_warnings", lambda mesh: ["too coarse"])
    assert len(failed(limits.limits(False, None))) == 1


def test_differences_beyond_the_error_estimate_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    from scenes.stress import defects as module

    def bake(*arguments, **options):
        baked = module_bake(*arguments, **options)
        object.__setattr__(baked, "error", baked.error / 2)
        return baked

    module_bake = module.bake
    monkeypatch.setattr(module, "bake", bake)
    assert len(failed(islice(defects(False, None), 3))) == 3


def test_pictures_without_shadow_rays_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from scenes.stress import pictures as module

    shaded = module.render
    monkeypatch.setattr(
        module, "render", lambda scene, camera, settings, **options: shaded(
            scene, camera, replace(settings, shadows=False), **options
        )
    )  # fmt: skip
    assert sum("inside a closed" in case for case in failed(pictures(False, None))) == 2


def test_the_table_tells_a_failure_and_a_nan() -> None:
    good, bad = Line("a", "b", "error", 0.1, 0.2), Line("c", "d", "error", 0.3, 0.2)
    assert stress_table([good]).endswith("all 1 within what is allowed")
    assert stress_table([good, bad]).endswith("1 of 2 failed")
    assert not Line("a", "b", "error", float("nan"), 1.0).ok
    assert not Line("a", "b", "error", 0.0, 1.0, undefined=1).ok


@pytest.mark.parametrize(("options", "words"), [(["--long"], "--stress"), (["--stress", "--samples", 64], "--samples")])
def test_options_that_contradict_are_refused(options, words) -> None:
    refused(obscurance("validate", *options), words)
