"""Shared parts of the small cases for faults that fuzzing found."""

from types import SimpleNamespace

import numpy as np
import pytest
from gltf_files import TRIANGLE, Builder

from obscurance.raytrace.errors import InputError
from obscurance.scenes.description.read import read_scene

PLANE = {"objects": [{"builtin": "plane", "fineness": 1.0}]}


def scene_mistake(tmp_path, text, name="m.toml"):
    """The message of the error that reading this scene must give."""
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        read_scene(tmp_path / name, (8, 6))
    message = str(error.value)
    assert message.isprintable()
    assert message.startswith(str(tmp_path))
    return message


def triangle():
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE))
    return builder


def baked(count):
    """A bake of that many vertices."""
    return SimpleNamespace(
        w=np.ones(count),
        error=np.zeros(count),
        bent_normals=np.zeros((count, 3)),
        flags=np.zeros(count, np.uint8),
        profile=None,
        at="vertices",
        below=None,
    )
