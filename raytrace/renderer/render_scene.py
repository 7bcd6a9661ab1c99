"""A scene in render space as kernels read it: geometry built once, and beside it what may change without it."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ..lights import layout as light_rows
from ..lights.far_lights import make_far_lights_directional
from ..lights.sources import BaseLight, pack_lights
from ..scene import Scene
from ..settings import Normals
from ..shade.records import Lights
from ..types import Float64s
from .geometry import BuiltGeometry, build_geometry


@dataclass(frozen=True, eq=False)
class RenderScene:
    """A scene ready for kernels.

    Attributes:
        geometry: shared by all scenes of the same shapes in the same places, whatever their w and lights.
        w: float64 (n,), obscurance at the vertices of all objects in order.
        lights: in render space.
    """

    geometry: BuiltGeometry
    w: Float64s
    lights: Lights


_scenes: WeakKeyDictionary[Scene, RenderScene] = WeakKeyDictionary()


def build(scene: Scene, normals: Normals = "file") -> RenderScene:
    """`scene` with such vertex normals, made when it is first asked for and kept as long as the scene.

    Raises:
        EmbreeError: Embree failed, out of memory for instance.
    """
    made = _scenes.get(scene)
    if made is None or made.geometry.normals != normals:
        geometry = build_geometry(scene.objects, normals)
        w = [np.ones(len(item.shape.mesh.vertices)) if item.w is None else item.w for item in scene.objects]
        lights = _place_lights(scene.lights, geometry.centre, geometry.scale)
        made = _scenes[scene] = RenderScene(geometry, np.concatenate(w), lights)
    return made


def release(scene: Scene) -> None:
    """Let go of what `build` keeps for a scene."""
    _scenes.pop(scene, None)


def _place_lights(lights: tuple[BaseLight, ...], centre: Float64s, scale: float) -> Lights:
    """Positions and attenuation in render space; black lights are left out."""
    kinds, rows = pack_lights(list(lights))
    rows[:, light_rows.POSITION : light_rows.POSITION + 3] = scale * (
        rows[:, light_rows.POSITION : light_rows.POSITION + 3] - centre
    )
    radial = rows[:, light_rows.RADIAL : light_rows.RADIAL + 3]
    radial /= scale ** np.arange(3)
    largest = np.where(radial.any(axis=1), radial.max(axis=1), 1.0)[:, None]  # kept out of what float32 can hold
    radial /= largest
    rows[:, light_rows.INTENSITY : light_rows.INTENSITY + 3] /= largest
    rows[:, light_rows.INVERSE_RANGE] /= scale
    make_far_lights_directional(kinds, rows)
    bright = rows[:, light_rows.INTENSITY : light_rows.INTENSITY + 3].any(axis=1)
    return Lights(kinds[bright], rows[bright])
