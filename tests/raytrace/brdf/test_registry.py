"""A reflection model from outside the package: the one that CONTRIBUTING.md shows, read and rendered."""

import re
import subprocess
import sys

import pytest
from project import ROOT, environment

from raytrace import Lambert
from raytrace.brdf.registry import reflection_model, reflection_models
from raytrace.errors import OptionError

RENDERED = """
import numpy as np
from raytrace import Camera, DirectionalLight, Object, Scene, Settings, Shape, material_from_dict, reflect, render
from scenes.geometry.primitives import sphere

matt = material_from_dict({"model": "minnaert", "albedo": [0.2, 0.4, 0.6], "k": 1.7})
assert isinstance(matt, Minnaert) and matt.to_dict()["k"] == 1.7
light, viewer = np.array([-0.48, -0.6, 0.64]), np.array([0, -1.0, 0])
scene = Scene((Object(Shape(sphere(0.5, 0.05).mesh, matt)),), (DirectionalLight(direction=tuple(-light), intensity=2),))
settings = Settings(width=40, height=40, samples=1, shadows=False)
layers = render(scene, Camera(tuple(1e4 * viewer), (0, 0, 0), height=1), settings).layers
hit = layers["object_id"][..., 0] == 1
normals = layers["normal"][hit].astype(float)
cosines = np.maximum(0, normals @ light), np.maximum(0, normals @ viewer)
expected = (cosines[0] ** 1.7 * cosines[1] ** 0.7 / np.pi)[:, None] * matt.albedo
assert (expected[:, 0] > 0.01).sum() > 300
np.testing.assert_allclose(layers["diffuse"][hit], 2 * expected, rtol=1e-3, atol=1e-4)
np.testing.assert_allclose(reflect(matt, normals, light, viewer), expected, rtol=1e-6, atol=1e-12)
assert not layers["specular"].any()
"""


def test_a_model_of_one_s_own_is_rendered():
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## A reflection model")[2]
    example = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0]
    script = [sys.executable, "-c", example + RENDERED]
    done = subprocess.run(script, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_models_are_in_the_order_of_their_names():
    names = [model.model for model in reflection_models()]
    assert names == sorted(names)
    assert len({model.kind for model in reflection_models()}) == len(names) >= 11


def test_a_model_is_registered_once_and_before_the_first_use_of_any():
    with pytest.raises(OptionError, match="Lambert: model: expected a name of its own, and models before the first"):
        reflection_model(Lambert.terms)(Lambert)
