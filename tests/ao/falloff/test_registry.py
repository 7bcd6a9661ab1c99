"""A falloff from outside the package: the one that CONTRIBUTING.md shows, against its formula and its integral."""

import re
import subprocess
import sys

from project import ROOT, environment

BAKED = """
import numpy as np
from obscurance import ao
from obscurance.ao.closed_forms import wall
from obscurance.raytrace import Mesh
from obscurance.scenes.falloffs import make_falloff
from obscurance.scenes.geometry.polyhedra import join, patches, polygon

falloff = make_falloff("smoother", max_distance="50%")
assert falloff == Smoother("50%")
t = np.linspace(0, 1, 100)
np.testing.assert_allclose(falloff.resolve(4.0)(2 * t), t**3 * (10 - 15 * t + 6 * t**2), atol=1e-6)
assert falloff.resolve(4.0)(5.0) == 1.0

far = np.array([[0.5, -40, 0], [0.5, 40, 0], [0.5, 40, 40], [0.5, -40, 40]])
mesh = Mesh(*join([patches([(0.0, 0.0, 0.0)], 0.1), polygon(far)]))
measured = ao.bake(mesh, Smoother(3.0), samples=16384).w[0]
assert abs(measured - wall(0.5, tau="smoother", max_distance=3.0)) < 1e-3
assert abs(measured - wall(0.5, tau="smooth", max_distance=3.0)) > 5e-3
"""


def test_a_falloff_of_one_s_own_is_baked_by():
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## A falloff")[2]
    example = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0]
    assert len(example.splitlines()) <= 10
    script = [sys.executable, "-c", example + BAKED]
    done = subprocess.run(script, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
