"""The stability suite as a test, and proof that each of its groups can fail."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from raytrace.ray_origins.origins import offsets_and_reaches, ray_offset

from . import defects as defects_module
from . import limits as limits_module
from . import pictures as pictures_module
from . import rays
from .closed_forms import closed_forms
from .contacts import contacts
from .defects import defects
from .limits import limits
from .line import Line
from .pictures import pictures
from .pose import OFFSETS, SCALES, Pose, poses
from .topology import topology

GROUPS = (closed_forms, rays.self_hits, rays.leaks, contacts, topology, defects, limits, pictures)


def failed(lines) -> list[str]:
    """The lines that do not pass; all are printed, for `pytest -rP`."""
    lines = list(lines)
    print(*lines, sep="\n")
    return [str(line) for line in lines if not line.ok]


@pytest.mark.parametrize("long", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["short", "long"])
@pytest.mark.parametrize("group", GROUPS, ids=[group.__name__ for group in GROUPS])
def test_what_is_measured_is_allowed(group, long) -> None:
    assert failed(group(long)) == []


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


def scale_offsets(monkeypatch, factor):
    """Let rays start so many times as far from the surface."""

    def scaled(*arguments):
        offset, touching, reach = offsets_and_reaches(*arguments)
        return factor * offset, touching, reach

    origins = "raytrace.ray_origins.origins"
    monkeypatch.setattr(f"{origins}.offsets_and_reaches", scaled)
    monkeypatch.setattr(f"{origins}.ray_offset", lambda *arguments: factor * ray_offset(*arguments))


def test_rays_that_start_on_the_surface_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    scale_offsets(monkeypatch, 0.0)
    assert len(failed(islice(rays.self_hits(False), 3))) >= 2


def test_rays_that_mind_only_their_own_faces_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytrace.ray_origins.origins.resolve_contacts", lambda *arguments: None)
    edged = {name: rays.closed()[name] for name in ("cube, hard edges", "cube with T-junctions")}
    monkeypatch.setattr(rays, "closed", lambda: edged)
    monkeypatch.setattr(rays, "poses", lambda long: [Pose(turn=4)])
    monkeypatch.setattr(rays, "_SINGLE", [])
    assert len(failed(islice(rays.leaks(False), 2))) == 2
    assert len(failed(contacts(False))) >= 3


def test_offsets_that_pass_through_a_plate_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    scale_offsets(monkeypatch, 4.0)
    monkeypatch.setattr("raytrace.ray_origins.origins.stop_short", lambda *arguments: None)
    assert any("face to face" in line.case for line in contacts(False) if not line.ok)


def test_a_silent_limit_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits_module, "precision_warnings", lambda mesh: [])
    assert len(failed(limits(False))) == 5
    monkeypatch.setattr(limits_module, "precision_warnings", lambda mesh: ["too coarse"])
    assert len(failed(limits(False))) == 1


def test_differences_beyond_the_error_estimate_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    plain_bake = defects_module.bake

    def bake(*arguments, **options):
        baked = plain_bake(*arguments, **options)
        object.__setattr__(baked, "error", baked.error / 2)
        return baked

    monkeypatch.setattr(defects_module, "bake", bake)
    assert len(failed(islice(defects(False), 3))) == 3


def test_pictures_without_shadow_rays_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    shaded = pictures_module.render
    monkeypatch.setattr(
        pictures_module, "render", lambda scene, camera, settings, **options: shaded(
            scene, camera, replace(settings, shadows=False), **options
        )
    )  # fmt: skip
    assert sum("inside a closed" in case for case in failed(pictures(False))) == 2


def test_a_failure_and_a_nan_do_not_pass() -> None:
    assert Line("a", "b", "error", 0.1, 0.2).ok
    assert not Line("c", "d", "error", 0.3, 0.2).ok
    assert not Line("a", "b", "error", float("nan"), 1.0).ok
    assert not Line("a", "b", "error", 0.0, 1.0, undefined=1).ok
