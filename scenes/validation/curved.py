"""Validation scenes of tessellated spheres, cylinders and disks, with w known between two bounds."""

from collections.abc import Callable
from math import asin, cos, exp, hypot, pi, sin, sqrt
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import quad

from ao.analytic import closed_forms as analytic
from ao.analytic.closed_forms import Rate
from ao.analytic.special import bickley
from ao.falloff import Binary, Exponential, Falloff, Linear, Smooth
from raytrace.mesh.mesh import Mesh
from raytrace.types import Int64s

from ..geometry.polyhedra import RawMesh, icosphere, inscribed_radius, join, patches, polygon, prism
from .configurations import ClosedForm, Setting, posed

BOTH: tuple[Falloff, ...] = (Binary(), Exponential(tau=1.0))
SUBDIVISIONS = 5
SIDES = 512
LENGTH = 200.0


def curved_settings() -> list[Setting]:
    sphere = icosphere(SUBDIVISIONS)
    return [
        _dome(sphere),
        _disk(0.8, 0.5, 31),
        _disk(0.7, 1.4, 32),
        _disk(0.3, 0.5, 37, "coaxial disk, cone of 80°", spread=80.0),
        _disk(0.8, 0.5, 38, "disk behind the back of another", back_faces="ignore"),
        _sphere_above(sphere),
        _inside_sphere(sphere),
        _inside_sphere(sphere, thickness=True),
        _inside_cylinder(),
        _cylinder(),
    ]


def _posed(name: str, part: RawMesh, seed: int, points: Int64s, normals: npt.ArrayLike) -> Mesh:
    """A mesh with normals at `points` and none elsewhere: the stand-in's other vertices need no bake."""
    all_normals = np.full((len(part[0]), 3), np.nan)
    all_normals[points] = normals
    return posed(part, seed, all_normals, source=name)


def _above_plane(
    name: str,
    points: npt.ArrayLike,
    part: RawMesh,
    bounds: tuple[ClosedForm, ClosedForm],
    falloffs: tuple[Falloff, ...] = BOTH,
    *,
    seed: int,
    missing: float = 0.0,
    certain: bool = False,
    **options: Any,
) -> Setting:
    """Receivers in the plane z = 0 under `part`, whose own vertices are not baked.

    Args:
        bounds: exact w, and that of the smaller shape which `part` contains (`Setting.bracket`).
        options: of `ao.bake`.
    """
    receivers = np.asarray(points, dtype=np.float64)
    which = 3 * np.arange(len(receivers))
    return Setting(
        name=name,
        mesh=_posed(name, join([patches(receivers), part]), seed, which, (0.0, 0.0, 1.0)),
        points=which,
        exact=bounds[0],
        falloffs=falloffs,
        normals="file",
        missing=missing,
        beyond=LENGTH / 2,
        bracket=bounds[1],
        certain=certain,
        options=options,
    )


def _bounds(
    w: Callable[[float, Rate, float], npt.ArrayLike], radius: float, inner: float
) -> tuple[ClosedForm, ClosedForm]:
    """w(radius, τ, limit) of a shape of `radius` and of the one of radius `inner` within it."""
    return lambda tau, limit: w(radius, tau, limit), lambda tau, limit: w(inner, tau, limit)


def _dome(sphere: RawMesh) -> Setting:
    radius = 1.5
    vertices, faces = sphere
    cap = faces[vertices[faces][:, :, 2].max(axis=1) > -0.1]
    inner = radius * inscribed_radius((vertices, cap))
    limited = (Binary(1.2), Exponential(tau=1.0, max_distance=2.0), Linear(2.0), Smooth(2.0))
    bounds = _bounds(analytic.dome, radius, inner)
    falloffs = (*BOTH, Exponential(tau=0.001), Exponential(tau=10.0), *limited)
    return _above_plane("dome", [(0.0, 0.0, 0.0)], (radius * vertices, cap), bounds, falloffs, seed=30, certain=True)


def _disk(radius: float, height: float, seed: int, name: str = "coaxial disk", **options: Any) -> Setting:
    angle = 2 * pi * np.arange(SIDES) / SIDES
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(SIDES, height)], axis=-1)
    reach = 0.5 * (height + hypot(radius, height))
    inner, spread, part = radius * cos(pi / SIDES), options.get("spread", 180.0), polygon(rim)
    if "back_faces" in options:
        part = join([(part[0], part[1][:, ::-1]), polygon(0.5 * rim)])
    bounds = _bounds(lambda r, tau, limit: analytic.disk(height, r, tau, limit, spread), radius, inner)
    falloffs = (*BOTH, Binary(reach), Exponential(tau=3.0, max_distance=reach), Linear(reach), Smooth(2 * reach))
    return _above_plane(name, [(0.0, 0.0, 0.0)], part, bounds, falloffs, seed=seed, **options)


def _sphere_above(sphere: RawMesh) -> Setting:
    radius, height, offsets = 0.8, 1.0, (0.0, 0.6, 1.5)
    inner = radius * inscribed_radius(sphere)
    points = [(x * cos(k), x * sin(k), 0.0) for k, x in enumerate(offsets)]
    bounds = _bounds(lambda r, tau, limit: [analytic.sphere(r, height, x, tau) for x in offsets], radius, inner)
    raised = (radius * sphere[0] + [0, 0, height], sphere[1])
    return _above_plane("sphere above a plane", points, raised, bounds, (*BOTH, Exponential(tau=4.0)), seed=33)


def chord_within(angle: float, radius: float, inner: float) -> float:
    """Least length of a chord from a corner p of a convex shape that holds the concentric circle of radius `inner`.

    The hull of p, at distance `radius` from the centre, and that circle is left at R cosψ + √(r² − R² sin²ψ), ψ the
    angle to the centre; beside it nothing is known, so 0.
    """
    within = inner**2 - (radius * sin(angle)) ** 2
    return radius * cos(angle) + sqrt(within) if within > 0 else 0.0


def _seen_from_within(weight: Callable[[float, float], float], radius: float, inner: float) -> ClosedForm:
    """w at a corner of a convex shape of `radius` that holds a circle or sphere of radius `inner`, at least.

    Args: weight: (angle, τ·distance) → what directions at that angle to the centre add to 1 − w.
    """

    def w(tau: Rate, limit: float) -> float:
        if tau is None:
            return 0.0

        def reached(angle: float) -> float:
            return weight(angle, float(tau) * chord_within(angle, radius, inner))

        edge = asin(inner / radius)
        return 1.0 - quad(reached, 0, edge, epsabs=1e-11)[0] - quad(reached, edge, pi / 2, epsabs=1e-11)[0]

    return w


def _inside_sphere(sphere: RawMesh, thickness: bool = False) -> Setting:
    radius, name = 0.5, "thickness of a ball" if thickness else "inside a sphere"
    outwards = 1 if thickness else -1
    inner, points = radius * inscribed_radius(sphere), np.arange(0, len(sphere[0]), len(sphere[0]) // 16)
    part = radius * sphere[0], sphere[1][:, ::outwards]
    return Setting(
        name=name,
        mesh=_posed(name, part, 34, points, outwards * sphere[0][points]),
        points=points,
        exact=lambda tau, limit: analytic.inside_sphere(radius, tau),
        falloffs=(*BOTH, Exponential(tau=5.0)),
        normals="file",
        bracket=_seen_from_within(lambda a, depth: exp(-depth) * 2 * sin(a) * cos(a), radius, inner),
        options={"thickness": thickness},
    )


def _missing(reach: float) -> float:
    """Cosine weight of the directions that leave an infinite cylinder's neighbourhood at its two ends.

    What lies beyond ±LENGTH/2 along y and within `reach` of that line is seen at angles below a = 2·reach/LENGTH from
    ±y: at most 2πa² of solid angle, where cosθ ≤ a; over π.
    """
    return 2 * (2 * reach / LENGTH) ** 3


def _inside_cylinder() -> Setting:
    radius = 0.5
    inner, points = radius * cos(pi / SIDES), SIDES + np.arange(0, SIDES, SIDES // 16)
    vertices, faces = prism(SIDES, LENGTH / radius, 3)
    part = radius * vertices, faces[:, ::-1]
    return Setting(
        name="inside a cylinder",
        mesh=_posed("inside a cylinder", part, 35, points, -vertices[points]),
        points=points,
        exact=lambda tau, limit: analytic.inside_cylinder(radius, tau),
        falloffs=(*BOTH, Exponential(tau=5.0)),
        normals="file",
        missing=_missing(2 * radius),
        beyond=LENGTH / 2,
        bracket=_seen_from_within(lambda a, depth: 4 / pi * cos(a) * float(bickley(3, depth)), radius, inner),
    )


def _cylinder() -> Setting:
    radius, height, offsets = 0.4, 0.6, (0.0, 0.5, -1.5)
    inner = radius * cos(pi / SIDES)
    vertices, faces = prism(SIDES, LENGTH / radius)
    far = height + radius + max(map(abs, offsets))
    name, falloffs = "cylinder parallel to a plane", (Binary(), Exponential(tau=3.0))
    bounds = _bounds(lambda r, tau, limit: [analytic.cylinder(r, height, x, tau) for x in offsets], radius, inner)
    raised = (radius * vertices + [0, 0, height], faces)
    points = [(x, 0.0, 0.0) for x in offsets]
    return _above_plane(name, points, raised, bounds, falloffs, seed=36, missing=_missing(far))
