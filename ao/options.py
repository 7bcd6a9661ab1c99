"""The options of a bake, checked before any work is done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError, OptionError, nearest_name
from raytrace.mesh.mesh import Mesh
from raytrace.system.threads import thread_count

from .falloff import Binary, Exponential, Falloff

if TYPE_CHECKING:
    from .gather.receivers import Normals
    from .interior.inside import Hidden

Method = Literal["vertex", "surface"]

MAX_SAMPLES = 1 << 20
DEFAULT_SAMPLES = 256
_MOST_FOR_TOLERANCE = 1 << 14


@dataclass(frozen=True, eq=False)
class Options:
    """Arguments of `ao.bake` beside mesh and falloff, see there for units and ranges.

    Raises:
        OptionError: one is out of range, does not go with another, or is of the other method.
    """

    method: Method = "vertex"
    samples: int | None = None
    seed: int = 0
    threads: int | None = None
    normals: Normals = "angle"
    only: npt.NDArray[np.bool_] | None = None
    tolerance: float | None = None
    reconstruct: bool = True
    hidden: Hidden = "auto"
    skip: bool = True

    def __post_init__(self) -> None:
        _check_name("method", self.method, ("vertex", "surface"))
        if self.samples is not None:
            _check_whole("samples", self.samples, 1, MAX_SAMPLES)
        _check_whole("seed", self.seed, 0, 2**64 - 1)
        thread_count(self.threads)
        _check_name("hidden", self.hidden, ("auto", "ignore", "mark", "fill"))
        if self.method == "surface":
            for name in ("tolerance", "reconstruct", "hidden", "skip"):
                if getattr(self, name) != getattr(Options, name):
                    raise OptionError(name, "method vertex with it", "method surface")
        if self.tolerance is None:
            return
        number = isinstance(self.tolerance, int | float) and not isinstance(self.tolerance, bool)
        if not number or not 1e-5 <= self.tolerance <= 1:
            raise OptionError("tolerance", "a number from 1e-5 to 1", self.tolerance)
        if self.only is not None:
            raise OptionError("only", "no mask of vertices together with a tolerance", "both")
        if not self.reconstruct:
            raise OptionError("reconstruct", "reconstruction together with a tolerance", "none")

    @property
    def rays(self) -> int:
        """Rays a vertex; the most, if there is a tolerance."""
        if self.samples is not None:
            return self.samples
        return DEFAULT_SAMPLES if self.tolerance is None else _MOST_FOR_TOLERANCE


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


def _check_name(field: str, value: object, names: tuple[str, ...]) -> None:
    if value not in names:
        raise OptionError(field, f"{', '.join(names[:-1])} or {names[-1]}", repr(value))


def _check_whole(field: str, value: object, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
        raise OptionError(field, f"a whole number from {low} to {high}", value)
