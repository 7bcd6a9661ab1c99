"""The baker against an independent slow one, vertex by vertex."""

from __future__ import annotations

from functools import cache
from math import inf

import numpy as np
import pytest
import reference
from meshes import MESHES

from obscurance import ao
from obscurance.raytrace import Mesh

pytestmark = pytest.mark.usefixtures("w_alone")

SETTINGS = {
    "binary": (ao.Binary(), None, inf),
    "binary within 0.9": (ao.Binary(0.9), None, 0.9),
    "exponential": (ao.Exponential(tau=1.7), 1.7, inf),
    "exponential within 0.9": (ao.Exponential(tau=1.7, max_distance=0.9), 1.7, 0.9),
}
SEEDS = 8
RAYS = 1200


@cache
def distances(name: str) -> np.ndarray:
    return reference.distances(*MESHES[name], rays=RAYS, seed=3)


def truth(name: str, setting: str) -> reference.Reference:
    return reference.estimate(distances(name), *SETTINGS[setting][1:])


def z_scores(name: str, setting: str, w: np.ndarray) -> np.ndarray:
    """Deviations (n,) of the seeds' mean from the reference, w (seeds, n), over their joint standard error.

    A vertex whose rays all agreed may still hide a part 1/rays of disagreement.
    """
    slow = truth(name, setting)
    floor = 1 / RAYS
    spread = w.var(axis=0, ddof=1) / len(w)
    return (w.mean(axis=0) - slow.w) / np.sqrt(slow.error**2 + spread + floor**2)


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("name", MESHES)
def test_agrees_at_every_vertex(name: str, setting: str) -> None:
    falloff = SETTINGS[setting][0]
    w = np.array([ao.bake(Mesh(*MESHES[name]), falloff, samples=256, seed=seed).w for seed in range(SEEDS)])
    z = z_scores(name, setting, w)
    assert np.abs(z).max() < 4.5  # one of about 1,200 scores, once in 100 suites
    assert np.mean(z**2) < 1.8
