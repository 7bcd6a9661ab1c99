"""A reflection model from outside the package: the one that CONTRIBUTING.md shows, read and reflected."""

import re
import subprocess
import sys

import pytest
from project import ROOT, environment

from obscurance.raytrace import Lambert
from obscurance.raytrace.brdf.registry import reflection_model, reflection_models
from obscurance.raytrace.errors import OptionError

ALONE = """
from obscurance.raytrace.brdf import registry
registry.iter_modules = lambda _: ()
"""
REFLECTED = """
import numpy as np
from obscurance.raytrace import material_from_dict, reflect

matt = material_from_dict({"model": "minnaert", "albedo": [0.2, 0.4, 0.6], "k": 1.7})
assert isinstance(matt, Minnaert) and matt.to_dict()["k"] == 1.7
light, viewer = np.array([-0.48, -0.6, 0.64]), np.array([0, -1.0, 0])


def expected_at(normals):
    cosines = np.maximum(0, normals @ light), np.maximum(0, normals @ viewer)
    return (cosines[0] ** 1.7 * cosines[1] ** 0.7 / np.pi)[:, None] * matt.albedo


turned = np.random.default_rng(0).normal(size=(16, 3))
turned /= np.linalg.norm(turned, axis=1)[:, None]
np.testing.assert_allclose(reflect(matt, turned, light, viewer), expected_at(turned), rtol=1e-6, atol=1e-12)
"""
IN_LANES = """
from obscurance.raytrace.brdf.dispatch import terms_in_lanes
from obscurance.raytrace.kernel import build, library
from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.kernel.simd import load_row, store_row


@kernel
def sixteen(kind, row, vectors, out):
    '''As the renderer asks: of the points that face the light.'''
    n = load_row(vectors, 0), load_row(vectors, 1), load_row(vectors, 2)
    l = load_row(vectors, 3), load_row(vectors, 4), load_row(vectors, 5)
    v = load_row(vectors, 6), load_row(vectors, 7), load_row(vectors, 8)
    d, s = terms_in_lanes(kind, row, n, l, v, n, n[0] * l[0] + n[1] * l[1] + n[2] * l[2] > 0.0)
    for c in range(3):
        store_row(out, c, d[c])
        store_row(out, 3 + c, s[c])


vectors, out = aligned((9, 16), np.float32), aligned((6, 16), np.float32)
vectors[:3], vectors[3:6], vectors[6:] = turned.T, light[:, None], viewer[:, None]
sixteen(*matt.pack(), vectors, out)
lit = turned @ light > 0
assert 4 < lit.sum() < 12
np.testing.assert_allclose(out[:3, lit].T, expected_at(turned)[lit], rtol=1e-3, atol=1e-4)
assert not out[3:, lit].any()
for entry in build.entries("obscurance.raytrace.shade.tile"):
    assert library.find(entry.signature.symbol, entry.function) is None or "render_tiles" not in entry.signature.line
"""
RENDERED = """
from obscurance.raytrace import Camera, DirectionalLight, Object, Scene, Settings, Shape, render
from obscurance.scenes.geometry.primitives import sphere

scene = Scene((Object(Shape(sphere(0.5, 0.05).mesh, matt)),), (DirectionalLight(direction=tuple(-light), intensity=2),))
settings = Settings(width=40, height=40, samples=1, shadows=False)
layers = render(scene, Camera(tuple(1e4 * viewer), (0, 0, 0), height=1), settings).layers
hit = layers["object_id"][..., 0] == 1
expected = expected_at(layers["normal"][hit].astype(float))
assert (expected[:, 0] > 0.01).sum() > 300
np.testing.assert_allclose(layers["diffuse"][hit], 2 * expected, rtol=1e-3, atol=1e-4)
assert not layers["specular"].any()
"""


def run(*parts):
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## A reflection model")[2]
    example = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0]
    script = [sys.executable, "-c", "".join((example, *parts))]
    done = subprocess.run(script, env=environment(NUMBA_OPT="1"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_model_of_one_s_own_is_reflected():
    """By kernels of this model alone, which take less time to compile."""
    run(ALONE, REFLECTED)


@pytest.mark.slow
@pytest.mark.parametrize("then", [IN_LANES, RENDERED], ids=["in lanes", "rendered"])
def test_a_model_of_one_s_own_is_reflected_in_lanes_and_rendered(then):
    """Compiles all models, or the renderer; none of the library, which does not know this one, is taken."""
    run(REFLECTED, then)


def test_models_are_in_the_order_of_their_names():
    names = [model.model for model in reflection_models()]
    assert names == sorted(names)
    assert len({model.kind for model in reflection_models()}) == len(names) >= 11


def test_a_model_is_registered_once_and_before_the_first_use_of_any():
    with pytest.raises(OptionError, match="Lambert: model: expected a name of its own, and models before the first"):
        reflection_model(Lambert.terms)(Lambert)
