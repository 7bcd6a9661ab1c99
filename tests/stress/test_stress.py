"""The stability suite as a test, and proof that each of its groups can fail."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import pytest
from ray_starts import change_origins, scaled_offsets

from obscurance.ao import bake
from obscurance.raytrace import render

from . import rays
from .closed_forms import closed_forms
from .contacts import contacts
from .defects import defects
from .limits import limits
from .line import Line
from .pictures import pictures
from .pose import Pose
from .solids import closed
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


@pytest.mark.slow
def test_rays_that_start_on_the_surface_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    change_origins(monkeypatch, **scaled_offsets(0.0))
    assert len(failed(islice(rays.self_hits(False), 3))) >= 2


@pytest.mark.slow
def test_rays_that_mind_only_their_own_faces_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    change_origins(monkeypatch, resolve_contacts=lambda *_: None)
    edged = ("cube, hard edges", "cube with T-junctions")
    assert len(failed(rays.leak(name, closed()[name], [Pose(turn=4)]) for name in edged)) == 2
    assert len(failed(contacts(False))) >= 3


@pytest.mark.slow
def test_offsets_that_pass_through_a_plate_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    change_origins(monkeypatch, stop_short=lambda *_: None, **scaled_offsets(4.0))
    assert any("face to face" in line.case for line in contacts(False) if not line.ok)


def test_a_silent_limit_fails() -> None:
    assert len(failed(limits(False, lambda mesh: []))) == 5
    assert len(failed(limits(False, lambda mesh: ["too coarse"]))) == 1


@pytest.mark.slow
def test_differences_beyond_the_error_estimate_fail() -> None:
    def too_sure(*arguments, **options):
        baked = bake(*arguments, **options)
        return replace(baked, error=baked.error / 2)

    assert len(failed(islice(defects(False, too_sure), 3))) == 3


@pytest.mark.slow
def test_pictures_without_shadow_rays_fail() -> None:
    def without_shadows(scene, camera, settings):
        return render(scene, camera, replace(settings, shadows=False))

    assert sum("inside a closed" in case for case in failed(pictures(False, without_shadows))) == 2


def test_a_failure_and_a_nan_do_not_pass() -> None:
    assert Line("a", "b", "error", 0.1, 0.2).ok
    assert not Line("c", "d", "error", 0.3, 0.2).ok
    assert not Line("a", "b", "error", float("nan"), 1.0).ok
    assert not Line("a", "b", "error", 0.0, 1.0, undefined=1).ok
