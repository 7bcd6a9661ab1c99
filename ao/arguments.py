"""What the bakers accept, checked before any work is done."""

from __future__ import annotations

from typing import Any

import numpy as np

from raytrace.errors import MeshError, OptionError, nearest_name
from raytrace.mesh.mesh import Mesh
from raytrace.system.threads import thread_count

from .falloff import Binary, Exponential, Falloff

MAX_SAMPLES = 1 << 20


def check_arguments(
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    tolerance: float | None = None,
    reconstruct: bool = True,
    hidden: str = "ignore",
    only: Any = None,
) -> None:
    """Refuse arguments of `ao.bake` that are out of range or don't go together. Raises: OptionError."""
    if samples is not None:
        _check_whole("samples", samples, 1, MAX_SAMPLES)
    _check_whole("seed", seed, 0, 2**64 - 1)
    thread_count(threads)
    if hidden not in ("auto", "ignore", "mark", "fill"):
        raise OptionError("hidden", "auto, ignore, mark or fill", repr(hidden))
    if tolerance is None:
        return
    if isinstance(tolerance, bool) or not isinstance(tolerance, int | float) or not 1e-5 <= tolerance <= 1:
        raise OptionError("tolerance", "a number from 1e-5 to 1", tolerance)
    if only is not None:
        raise OptionError("only", "no mask of vertices together with a tolerance", "both")
    if not reconstruct:
        raise OptionError("reconstruct", "reconstruction together with a tolerance", "none")


def falloff_of(given: Falloff | str | None) -> Falloff:
    """A falloff, by its name too; the exponential one for None.

    Raises:
        OptionError: neither a falloff nor the name of one.
    """
    if given is None:
        return Exponential()
    if isinstance(given, Binary | Exponential):
        return given
    named = {"binary": Binary, "exponential": Exponential}
    if isinstance(given, str) and given in named:
        return named[given]()
    expected = 'ao.Binary(…), ao.Exponential(…), "binary" or "exponential"'
    near = nearest_name(given, named) if isinstance(given, str) else None
    raise OptionError("falloff", expected, repr(given), "bake", near)


def mesh_of(given: Mesh | Any) -> Mesh:
    """A mesh, made of anything else that has vertices and faces.

    Raises:
        MeshError: it has none, or they are no mesh.
    """
    if isinstance(given, Mesh):
        return given
    try:
        vertices, faces = given.vertices, given.faces
    except AttributeError:
        expected = "a raytrace.Mesh, or anything else with vertices (n, 3) and faces (m, 3)"
        raise MeshError("bake", "mesh", expected, repr(given)) from None
    return Mesh(vertices, faces)


def _check_whole(name: str, value: object, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
        raise OptionError(name, f"a whole number from {low} to {high}", value)
