"""Validation scenes of tessellated spheres, cylinders and disks, with w known between two bounds."""

from collections.abc import Callable, Sequence
from functools import partial
from math import asin, cos, exp, hypot, pi, sin, sqrt
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import quad

from obscurance.ao import closed_forms as analytic
from obscurance.ao.closed_forms import Rate, bickley
from obscurance.ao.falloff import Binary, Exponential, Falloff, Linear, Smooth
from obscurance.raytrace.types import Int64s

from ..geometry.polyhedra import RawMesh, icosphere, inscribed_radius, join, patches, polygon, prism
from .configurations import BOTH, ClosedForm, ValidationCase, closed_form, posed

SUBDIVISIONS, SIDES, LENGTH = 5, 512, 200.0
AT_ORIGIN = [(0.0, 0.0, 0.0)]


def curved_cases() -> list[ValidationCase]:
    """Cases whose occluders are disks, spheres and cylinders, with exact w of what inscribes them, or bounds."""
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


def _case(
    name: str,
    seed: int,
    part: RawMesh,
    receivers: tuple[Int64s, npt.ArrayLike],
    bounds: Sequence[ClosedForm],
    falloffs: tuple[Falloff, ...],
    *,
    missing: float = 0.0,
    certain: bool = False,
    **options: Any,
) -> ValidationCase:
    """A case with one part: normals at its receivers, and none elsewhere, as other vertices of the stand-in need no
    bake.

    Args:
        receivers: rows and normals.
        bounds: exact w, and w of the smaller shape in `part`.
    """
    points = receivers[0]
    normals = np.full((len(part[0]), 3), np.nan)
    normals[points] = receivers[1]
    return ValidationCase(
        name,
        posed(part, seed, normals, source=name),
        points,
        bounds[0],
        falloffs,
        normals="file",
        missing=missing,
        beyond=LENGTH / 2,
        bracket=bounds[1],
        certain=certain,
        options=options,
    )


def _above_plane(
    name: str, seed: int, points: Sequence[tuple[float, float, float]], part: RawMesh, *about: Any, **options: Any
) -> ValidationCase:
    """`_case` of receivers in the plane z = 0 under `part`, whose own vertices are not baked."""
    first_corners = 3 * np.arange(len(points))
    joint = join([patches(points), part])
    return _case(name, seed, joint, (first_corners, (0.0, 0.0, 1.0)), *about, **options)


def _dome(sphere: RawMesh) -> ValidationCase:
    """A point at the centre of a hemisphere's floor."""
    radius = 1.5
    vertices, faces = sphere
    cap = faces[vertices[faces][:, :, 2].max(axis=1) > -0.1]
    inner = radius * inscribed_radius((vertices, cap))
    limited = (Binary(1.2), Exponential(tau=1.0, max_distance=2.0), Linear(2.0), Smooth(2.0))
    bounds = [closed_form(analytic.dome, (r,)) for r in (radius, inner)]
    falloffs = (*BOTH, Exponential(tau=0.001), Exponential(tau=10.0), *limited)
    return _above_plane("dome", 30, AT_ORIGIN, (radius * vertices, cap), bounds, falloffs, certain=True)


def _disk(radius: float, height: float, seed: int, name: str = "coaxial disk", **options: Any) -> ValidationCase:
    """A point under a disk that is perpendicular to its normal."""
    angle = 2 * pi * np.arange(SIDES) / SIDES
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(SIDES, height)], axis=-1)
    reach = 0.5 * (height + hypot(radius, height))
    inner = radius * cos(pi / SIDES)
    spread = options.get("spread", 180.0)
    part = polygon(rim)
    if "back_faces" in options:
        part = join([(part[0], part[1][:, ::-1]), polygon(0.5 * rim)])
    bounds = [closed_form(partial(analytic.disk, spread=spread), (height, r)) for r in (radius, inner)]
    falloffs = (*BOTH, Binary(reach), Exponential(tau=3.0, max_distance=reach), Linear(reach), Smooth(2 * reach))
    return _above_plane(name, seed, AT_ORIGIN, part, bounds, falloffs, **options)


def _sphere_above(sphere: RawMesh) -> ValidationCase:
    radius, height, offsets = 0.8, 1.0, (0.0, 0.6, 1.5)
    inner = radius * inscribed_radius(sphere)
    points = [(x * cos(k), x * sin(k), 0.0) for k, x in enumerate(offsets)]
    bounds = [closed_form(analytic.sphere, *((r, height, x) for x in offsets)) for r in (radius, inner)]
    raised = (radius * sphere[0] + [0, 0, height], sphere[1])
    return _above_plane("sphere above a plane", 33, points, raised, bounds, (*BOTH, Exponential(tau=4.0)))


def _seen_from_within(weight: Callable[[float, float], float], radius: float, inner: float) -> ClosedForm:
    """w at a corner p of a convex shape of `radius` R that holds a circle or sphere of radius `inner` r, at least.

    The hull of p and that circle is left at R cosψ + √(r² − R² sin²ψ), ψ the angle to the centre; beside it nothing is
    known, so 0.

    Args: weight: (angle, τ·distance) → what directions at that angle to the centre add to 1 − w.
    """

    def w(tau: Rate, limit: float) -> float:
        """The least w for this falloff."""
        if tau is None:
            return 0.0

        def reached(angle: float) -> float:
            """The share that hits at `angle` to the normal take away, 0 where the hull is beyond the circle."""
            squared_half_chord = inner**2 - (radius * sin(angle)) ** 2
            chord = radius * cos(angle) + sqrt(squared_half_chord) if squared_half_chord > 0 else 0.0
            return weight(angle, float(tau) * chord)

        edge = asin(inner / radius)
        within: float = quad(reached, 0, edge, epsabs=1e-11)[0]
        beside: float = quad(reached, edge, pi / 2, epsabs=1e-11)[0]
        return 1.0 - within - beside

    return w


def _inside_sphere(sphere: RawMesh, thickness: bool = False) -> ValidationCase:
    """Vertices of a sphere that looks inwards; or outwards, seen by rays into the solid, for `thickness`."""
    radius = 0.5
    outwards = 1 if thickness else -1
    inner = radius * inscribed_radius(sphere)
    points = np.arange(0, len(sphere[0]), len(sphere[0]) // 16)
    part = radius * sphere[0], sphere[1][:, ::outwards]
    normals = outwards * sphere[0][points]
    least = _seen_from_within(lambda a, depth: exp(-depth) * 2 * sin(a) * cos(a), radius, inner)
    return _case(
        "thickness of a ball" if thickness else "inside a sphere",
        34,
        part,
        (points, normals),
        (closed_form(analytic.inside_sphere, (radius,)), least),
        (*BOTH, Exponential(tau=5.0)),
        thickness=thickness,
    )


def _missing(reach: float) -> float:
    """Cosine weight of the directions that leave an infinite cylinder's neighbourhood at its two ends.

    What lies beyond ±LENGTH/2 along y and within `reach` of that line is seen at angles below a = 2·reach/LENGTH from
    ±y: at most 2πa² of solid angle, where cosθ ≤ a; over π.
    """
    return 2 * (2 * reach / LENGTH) ** 3


def _inside_cylinder() -> ValidationCase:
    """Vertices halfway along a long tube that looks inwards."""
    radius = 0.5
    inner = radius * cos(pi / SIDES)
    points = SIDES + np.arange(0, SIDES, SIDES // 16)
    vertices, faces = prism(SIDES, LENGTH / radius, 3)
    part = radius * vertices, faces[:, ::-1]
    normals = -vertices[points]
    least = _seen_from_within(lambda a, depth: 4 / pi * cos(a) * bickley(3, depth), radius, inner)
    return _case(
        "inside a cylinder",
        35,
        part,
        (points, normals),
        (closed_form(analytic.inside_cylinder, (radius,)), least),
        (*BOTH, Exponential(tau=5.0)),
        missing=_missing(2 * radius),
    )


def _cylinder() -> ValidationCase:
    radius, height, offsets = 0.4, 0.6, (0.0, 0.5, -1.5)
    inner = radius * cos(pi / SIDES)
    vertices, faces = prism(SIDES, LENGTH / radius)
    far = height + radius + max(map(abs, offsets))
    name, falloffs = "cylinder parallel to a plane", (Binary(), Exponential(tau=3.0))
    bounds = [closed_form(analytic.cylinder, *((r, height, x) for x in offsets)) for r in (radius, inner)]
    raised = radius * vertices + [0, 0, height], faces
    points = [(x, 0.0, 0.0) for x in offsets]
    return _above_plane(name, 36, points, raised, bounds, falloffs, missing=_missing(far))
