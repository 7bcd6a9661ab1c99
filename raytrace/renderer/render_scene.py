"""A scene in render space as kernels read it: geometry built once, and beside it what may change without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..kernel.arrays import aligned
from ..lights import kernels as light_rows
from ..lights.environment import pack_environment
from ..lights.kernels import incident
from ..lights.sources import BaseLight, LightSource, pack_lights
from ..scene import Object, Scene
from ..settings import Normals
from ..shade.layout import Lights
from ..types import Float32s, Float64s
from .geometry import BuiltGeometry, build_geometry, joined


@dataclass(frozen=True, eq=False)
class RenderScene:
    """A scene ready for kernels. Pickled, it goes to other processes, which build the geometry again."""

    objects: tuple[Object, ...]
    geometry: BuiltGeometry  # shared by all scenes of the same shapes in the same places, whatever their w and lights
    w: Float64s  # as `SceneArrays` has these
    bent: Float32s
    lights: Lights
    background: tuple[float, float, float]

    def __reduce__(self) -> tuple[Callable[..., RenderScene], tuple[object, ...]]:
        bare = tuple(replace(item, w=None, bent_normals=None) for item in self.objects)
        return _rebuilt, (bare, self.geometry.normals, self.w, self.bent, self.lights, self.background)


FAR = 2.0**24  # times the size of the scene: across it direction and attenuation change by less than a rounding
_scenes: WeakKeyDictionary[Scene, RenderScene] = WeakKeyDictionary()


def build(scene: Scene, normals: Normals = "file") -> RenderScene:
    """`scene` with such vertex normals, made when it is first asked for and kept as long as the scene.

    By "file" it is `scene.shaded`, which has more vertices where edges are hard.

    Raises: as `build_geometry`; InputError: the image of an environment light cannot be read.
    """
    built = _scenes.get(scene)
    if built is None or built.geometry.normals != normals:
        objects = (scene.shaded if normals == "file" else scene).objects
        geometry = build_geometry(objects, normals)
        w = [np.ones(len(item.shape.mesh.vertices)) if item.w is None else item.w for item in objects]
        lights = place_lights(scene.lights, geometry.centre, geometry.scale)
        looked_up = len(lights.skies) + len(lights.harmonics) > 0
        bent_normals = [item.bent_normals if looked_up else None for item in objects]
        bent = joined((item.shape.mesh for item in objects), bent_normals, 3)
        built = _scenes[scene] = RenderScene(objects, geometry, np.concatenate(w), bent, lights, scene.background)
    return built


def _rebuilt(
    objects: tuple[Object, ...], normals: Normals, w: Float64s, bent: Float32s, lights: Lights, background: Any
) -> RenderScene:
    """A pickled scene, its arrays padded so that kernels may read behind their ends."""
    padded_bent = aligned(bent.shape, np.float32)
    maps = aligned(lights.maps.shape, np.float32)
    padded_bent[:], maps[:] = bent, lights.maps
    return RenderScene(
        objects, build_geometry(objects, normals), w, padded_bent, lights._replace(maps=maps), background
    )


def release(scene: Scene) -> None:
    """Drop what `build` has kept for a scene."""
    _scenes.pop(scene, None)


def place_lights(lights: tuple[BaseLight, ...], centre: Float64s, scale: float) -> Lights:
    """Positions and attenuation in render space; black lights are left out, ambient ones added up.

    Point and spot lights beyond `FAR` of the origin become directional ones: in float32 their squared distance may
    overflow. Their intensity becomes what arrives at the origin.
    """
    kinds, light_table = pack_lights([light for light in lights if isinstance(light, LightSource)])
    position = light_table[:, light_rows.POSITION : light_rows.POSITION + 3]
    radial = light_table[:, light_rows.RADIAL : light_rows.RADIAL + 3]
    intensity = light_table[:, light_rows.INTENSITY : light_rows.INTENSITY + 3]
    position[:] = scale * (position - centre)
    with np.errstate(over="ignore"):  # of scenes too small for squares of their scale
        radial /= scale ** np.arange(3)
    largest = np.where(radial.any(axis=1), radial.max(axis=1), 1.0)[:, None]  # kept out of what float32 can hold
    radial /= largest
    intensity /= largest
    light_table[:, light_rows.INVERSE_RANGE] /= scale
    radius = light_table[:, light_rows.RADIUS]
    radius *= np.where(kinds == light_rows.DIRECTIONAL, 1.0, scale)
    np.minimum(radius, FAR, out=radius)
    for j, row in enumerate(light_table):
        if kinds[j] in (light_rows.POINT, light_rows.SPOT) and hypot(*position[j]) > FAR:
            l, distance, arriving = incident(int(kinds[j]), row, (0.0, 0.0, 0.0))
            row[: light_rows.RADIUS] = 0.0
            row[light_rows.RADIUS] /= distance
            row[light_rows.DIRECTION : light_rows.DIRECTION + 3] = np.negative(l)
            intensity[j] = arriving
            kinds[j] = light_rows.DIRECTIONAL
    everywhere = kinds == light_rows.AMBIENT
    is_used = intensity.any(axis=1) & ~everywhere
    return Lights(kinds[is_used], light_table[is_used], intensity[everywhere].sum(axis=0), *pack_environment(lights))
