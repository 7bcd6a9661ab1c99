"""Settings and cameras out of range are refused by name."""

import numpy as np
import pytest

from obscurance.raytrace import OptionError
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.settings import Settings


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"width": 0}, "width"),
        ({"samples": 0}, "samples"),
        ({"shading": "smooth"}, "shading"),
        ({"obscurance": "yes"}, "obscurance"),
        ({"normals": "own"}, "normals"),
        ({"crop": (0, 0, 2000, 1)}, "crop"),
        ({"seed": -1}, "seed"),
        ({"shadows": "no"}, "shadows: expected true or false"),
        ({"terminator": 1}, "terminator: expected true or false"),
    ],
)
def test_settings_out_of_range_are_named(fields, words):
    with pytest.raises(OptionError, match=words):
        Settings(**fields)


def test_a_switch_may_be_numpys():
    assert Settings(shadows=np.bool_(False)).shadows is False


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"target": (0, 0, 1)}, "target"),
        ({"up": (0, 0, 3)}, "up"),
        ({"position": (np.nan, 0, 0)}, "position"),
        ({"field_of_view": 180}, "field_of_view"),
        ({"height": 0}, "height"),
        ({"aperture": -1}, "aperture"),
        ({"focus": 0}, "focus"),
    ],
)
def test_cameras_out_of_range_are_named(fields, words):
    with pytest.raises(OptionError, match=f"camera: {words}"):
        Camera(**{"position": (0, 0, 1), "target": (0, 0, 0), "up": (0, 1, 0)} | fields)
