"""Shadows in rendered images: grazing light, light on a surface, light in a closed solid, light very far away."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from meshes import grid

from obscurance.raytrace import Camera, Frame, Lambert, Object, Scene, Settings, Shape, render
from obscurance.raytrace.lights.sources import BaseLight, DirectionalLight, PointLight
from obscurance.raytrace.system.parameters import Sides
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh, icosphere, join

from .line import LEAKS, MILLION, SELF_HITS, Line, undefined
from .pose import Pose
from .solids import cube

FAR = 1e30
GREY = (0.8, 0.8, 0.8)
_POSES = [Pose(turn=1), Pose(1e-9, 1e6, 2), Pose(1e9, 1e4, 3)]


def pictures(long: bool, render: Callable[[Scene, Camera, Settings], Frame] = render) -> Iterator[Line]:
    """A line for each kind of light, over the poses."""
    size = 1024 if long else 256

    def take(pose: Pose, part: RawMesh, light: BaseLight, eye: Float64s, two_sided: Sides = False) -> Frame:
        """A picture of a part of about unit size from `eye`, in the part's own frame."""
        scene = Scene((Object(Shape(pose.mesh(part), Lambert(albedo=GREY, two_sided=two_sided))),), (light,))
        where = _place(pose, part, eye)
        target = _place(pose, part, np.zeros(3))
        up = pose.directions(np.array([[0.3, 1.0, 0.2]]))[0].tolist()
        camera = Camera(where, target, up, height=2.0 * pose.scale)
        return render(scene, camera, Settings(size, size, samples=1))

    above = np.array([0.0, 0.0, 3.0])
    for name, part in (("plane", grid(40, 4.0)), ("icosphere", icosphere(4))):
        for slope in (1e-2, 1e-4):
            dark = seen = missing = 0
            for pose in _POSES:
                sun = DirectionalLight(
                    direction=pose.directions(np.array([[-1.0, 0.3, -slope]]))[0].tolist(), intensity=(3, 3, 3)
                )
                frame = take(pose, part, sun, above)
                facing = _hit(frame) & (_cosine(frame, sun) > 0.3 * slope)
                if name == "icosphere":  # behind the smooth surface's horizon the faces' own shadow is right
                    facing &= _cosine(frame, sun) > 0.15
                dark += int(np.count_nonzero(frame.layers["shadow"][facing] < 1))
                seen += int(np.count_nonzero(facing))
                missing += _undefined(frame)
            yield Line(
                f"{name}, light grazing at a slope of {slope:g}", f"{len(_POSES)} poses, {seen / MILLION:.2f} M rays",
                "self-hits/M", dark / seen * MILLION, SELF_HITS, missing,
            )  # fmt: skip

    missing = 0
    for pose in _POSES:
        for part in (grid(40, 4.0), icosphere(4)):
            for place in (part[0][len(part[0]) // 2], part[0][part[1][7]].mean(axis=0)):
                missing += _undefined(take(pose, part, _lamp(pose, part, place), above))
    yield Line("light on a surface, at a vertex and in a face", f"{len(_POSES)} poses", "NaN", missing, 0)

    floor = grid(40, 4.0)
    for name, solid in (("icosphere", icosphere(4)), ("cube, hard edges", cube(8))):
        lit = seen = missing = 0
        part = join([(0.4 * solid[0], solid[1]), (floor[0] - np.array([0, 0, 0.5]), floor[1])])
        for pose in _POSES:
            sides: tuple[Sides, ...] = (False, "viewer")
            for two_sided in sides:
                frame = take(pose, part, _lamp(pose, part, np.array([0.04, 0.08, 0.02])), above, two_sided)
                lit += int(np.count_nonzero(frame.layers["diffuse"][_hit(frame)].any(axis=1)))
                seen += int(np.count_nonzero(_hit(frame)))
                missing += _undefined(frame)
        yield Line(
            f"light inside a closed {name}, over a floor",
            f"{len(_POSES)} poses, {seen / MILLION:.2f} M rays",
            "leaks/M",
            lit / seen * MILLION,
            LEAKS,
            missing,
        )

    error, missing = 0.0, 0
    for pose in _POSES:
        part, way = icosphere(4), np.array([[0.6, 0.0, 0.8]])
        direction = pose.directions(way)[0]
        sun = DirectionalLight(direction=(-direction).tolist(), intensity=(1, 1, 1))
        lamp = PointLight(position=(FAR * direction).tolist(), intensity=(FAR**2,) * 3)
        near, far = (take(pose, part, light, above) for light in (sun, lamp))
        a, b = near.layers["beauty"][..., :3], far.layers["beauty"][..., :3]
        error = float(np.maximum(error, np.abs(a - b).max()))
        missing += _undefined(near) + _undefined(far)
    yield Line(
        "point light 10³⁰ away, against a directional one",
        f"{len(_POSES)} poses",
        "error of radiance",
        error,
        1e-4,
        missing,
    )


def _place(pose: Pose, part: RawMesh, point: Float64s) -> tuple[float, float, float]:
    """Where a point of a part's own frame lies."""
    return pose.vertices(part[0], point[None])[0].tolist()


def _lamp(pose: Pose, part: RawMesh, place: Float64s) -> PointLight:
    return PointLight(position=_place(pose, part, place), intensity=(10.0 * pose.scale**2,) * 3)


def _hit(frame: Frame) -> np.ndarray:
    return frame.layers["object_id"][..., 0] > 0


def _cosine(frame: Frame, sun: DirectionalLight) -> Float64s:
    return np.asarray(
        -frame.layers["normal"].astype(np.float64) @ np.array(sun.direction) / np.linalg.norm(sun.direction)
    )


def _undefined(frame: Frame) -> int:
    layers = [layer for name, layer in frame.layers.items() if name != "depth"]
    return undefined(*layers)
