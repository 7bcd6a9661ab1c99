"""The clay look of pages and reports: camera, light, clay, colours; the same in the browser and by `render`.

Clay is Lambert's, lit by ambient light and by one directional light that stands with the camera and throws no shadows;
w weights both, as in (12.75). So what a page draws can be rendered, and a test compares the two.
"""

from math import pi
from typing import Any, Literal

import numpy as np

from obscurance.raytrace import AmbientLight, Camera, DirectionalLight, Lambert, Mesh, Object, Scene, Settings, Shape
from obscurance.raytrace.mesh.corners import split_creases
from obscurance.raytrace.types import AnyFloats

Scheme = Literal["dark", "light"]
FIELD_OF_VIEW = 35.0
CLAY = (0.66, 0.58, 0.49)
AMBIENT, KEY = 0.4, 0.85  # light that a white surface reflects: ambient, and of the key light overhead
TOWARDS_KEY = (-0.45, 0.6, 0.66)  # from the surface to the right of the picture, upwards and to the viewer
BACKGROUND: dict[Scheme, tuple[float, float, float]] = {"dark": (0.009, 0.010, 0.013), "light": (0.60, 0.61, 0.62)}
"""Linear RGB."""
HEAT = ("#1b1838", "#52308f", "#b23a7c", "#f1794c", "#fdeaa8")  # sRGB from no error to the most, ever lighter
FLAGS = {
    "unreferenced": "#3d7bff",
    "degenerate": "#ffd000",
    "opposed": "#00c8dc",
    "hidden": "#ff1f9b",
    "folded": "#2fc82f",
    "missed": "#ff8a1f",
    "contact": "#8a5cff",
}
"""The colour of the dot on a vertex with a flag; in the order of the bits of `ao.Flag`."""
LOOK: dict[str, Any] = {
    "fieldOfView": FIELD_OF_VIEW,
    "clay": CLAY,
    "ambient": AMBIENT,
    "key": KEY,
    "towardsKey": TOWARDS_KEY,
    "background": BACKGROUND,
    "heat": HEAT,
    "difference": ("#1c4fa6", "#86b2e2", "#f0eeea", "#e59b73", "#9d2f1c"),
}
"""For a page's script; difference: sRGB."""


def clay_scene(mesh: Mesh, w: AnyFloats, camera: Camera, scheme: Scheme = "dark") -> Scene:
    """The scene whose picture by `clay_settings` is a page's clay × w, seen by `camera`; w (n,)."""
    right, above, forward = camera.axes()
    to_right, upwards, to_viewer = TOWARDS_KEY
    travels = forward * to_viewer - right * to_right - above * upwards
    key = DirectionalLight(direction=travels.tolist(), intensity=(pi * KEY,) * 3)  # Lambert's reflects 1/π of it
    drawn, _, vertices, _ = split_creases(mesh)
    clay = Object(Shape(drawn, Lambert(albedo=CLAY, two_sided="viewer")), w=np.asarray(w, np.float64)[vertices])
    return Scene((clay,), (key, AmbientLight(intensity=(AMBIENT,) * 3)), BACKGROUND[scheme])


def clay_settings(width: int, height: int, samples: int = 16) -> Settings:
    """Settings of a picture like a page's clay × w."""
    return Settings(width=width, height=height, samples=samples, obscurance="ambient and diffuse", shadows=False)
