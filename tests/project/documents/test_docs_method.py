"""The integrator at the head of docs/method.md computes w."""

import re

import numpy as np
import pytest
from project import ROOT

from obscurance import ao, scenes

PAGE = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
RAYS = 256


@pytest.fixture(scope="module")
def openness():
    names = {}
    exec(compile(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0], "method.md", "exec"), names)
    return names["openness"]


@pytest.mark.parametrize("falloff", ["binary", "exponential"])
def test_it_agrees_with_the_baker(openness, falloff):
    mesh = scenes.Sponge(level=1, fineness=0.25).geometry().mesh
    baked = ao.bake(mesh, falloff, samples=4096, denoise=False)
    off = openness(mesh, baked.mu, RAYS) - baked.w
    noise = 0.5 / np.sqrt(RAYS)  # at most, of independent rays
    assert np.sqrt(np.mean(off**2)) < noise
    assert abs(off.mean()) < 0.1 * noise
