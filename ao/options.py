"""The options of a bake, checked before any work is done."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Annotated, Any, Literal, ParamSpec, TypeVar

import numpy as np
from pydantic import Field, PlainValidator

from raytrace.errors import ConflictError, OptionError, nearest_name
from raytrace.system.parameters import Parameters, Seed, Switch, Whole
from raytrace.system.threads import MAX_THREADS
from raytrace.types import Bools

from .falloff import Binary, Exponential, Falloff, Tabulated
from .mu import Mu

Falloffs = Falloff | str | Sequence[Falloff | str] | None
P = ParamSpec("P")
R = TypeVar("R")
MAX_SAMPLES = 1 << 20
DEFAULT_SAMPLES = 256
_MOST_FOR_TOLERANCE = 1 << 14
_NO_RAYS = frozenset({"threads", "falloff"})  # the first because bits do not depend on it
_FITTED = 1 << 20  # rays in all of the surface method: a coarse mesh needs more a vertex than a dense one
_FITTED_FOR_TOLERANCE = 1 << 26
OCTAVES = tuple(0.005 * 2**octave for octave in range(10))  # half-distances of profiles, of the radius
_PROFILE = tuple(Exponential(half_distance=f"{100 * share:g}%") for share in OCTAVES)


def falloff_of(given: Falloff | str | None) -> Falloff:
    """A falloff, by its name too; the exponential one for None.

    Raises:
        OptionError: neither a falloff nor the name of one.
    """
    if given is None:
        return Exponential()
    if isinstance(given, Falloff):
        return given
    named = {"binary": Binary, "exponential": Exponential}
    if isinstance(given, str) and given in named:
        return named[given]()
    expected = 'ao.Binary(…), .Exponential(…), .Linear(…), .Smooth(…), .Tabulated(…), "binary" or "exponential"'
    near = nearest_name(given, named) if isinstance(given, str) else None
    raise OptionError("falloff", expected, repr(given), "bake", near)


def earlier_names(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function take keywords by their earlier names, too. Args: names: the present one of each."""

    def with_names(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def called(*unnamed: P.args, **named: P.kwargs) -> R:
            present: Any = {names.get(name, name): value for name, value in named.items()}
            return function(*unnamed, **present)

        return called

    return with_names


def falloffs_of(given: Falloffs) -> Falloff | tuple[Falloff, ...]:
    """A falloff, or those of a list. Raises: OptionError: as `falloff_of`, or the list is empty."""
    if given is None or isinstance(given, str | Falloff):
        return falloff_of(given)
    try:
        listed = tuple(map(falloff_of, given))
    except TypeError:
        return falloff_of(given)  # type: ignore[arg-type]  # for its message
    if not listed:
        raise OptionError("falloff", "a falloff or a list of falloffs", "an empty list", "bake")
    return listed


Method = Annotated[Literal["vertex", "surface"], Field(description="vertex or surface")]
Normals = Annotated[Literal["angle", "area", "equal", "file"], Field(description="angle, area, equal or file")]
Interior = Annotated[Literal["auto", "ignore", "mark", "fill"], Field(description="auto, ignore, mark or fill")]
Traversal = Annotated[Literal["auto", "embree"], Field(description="auto or embree")]
Samples = Annotated[Whole, Field(ge=1, le=MAX_SAMPLES)]
Threads = Annotated[Whole, Field(ge=1, le=MAX_THREADS)]
Mask = Annotated[Bools, PlainValidator(np.asarray)]
Tolerance = Annotated[float, Field(strict=True, ge=1e-5, le=1, description="a number from 1e-5 to 1")]


class Options(Parameters, kw_only=False, source="options"):
    """Arguments of `ao.bake` beside the mesh, see there for units and ranges.

    Raises:
        OptionError: one is out of range, does not go with another, or is of the other method.
    """

    method: Method = "vertex"
    falloff: Annotated[Falloff | tuple[Falloff, ...], PlainValidator(falloffs_of)] = Exponential()
    samples: Samples | None = None
    seed: Seed = 0
    threads: Threads | None = None
    normals: Normals = "angle"
    only: Mask | None = None
    tolerance: Tolerance | None = None
    denoise: bool = True
    interior: Interior = "auto"
    traversal: Traversal = "auto"
    profile: Switch = False

    def __post_init__(self) -> None:
        if self.method == "surface":
            for name in ("denoise", "interior", "traversal"):
                value = getattr(self, name)
                if value != getattr(Options, name):
                    raise ConflictError((name, value), "does not go with", ("method", "surface"))
            if self.profile or len(self.falloffs) > 1:
                several = "profile" if self.profile else "a list of falloffs"
                raise ConflictError(several, "does not go with", ("method", "surface"))
        first = self.falloffs[0]
        if self.profile and not isinstance(first, Tabulated) and str(first.max_distance) != "inf":
            raise ConflictError("profile", "excludes", "max_distance")
        if self.tolerance is None:
            return
        if self.only is not None:
            raise ConflictError("only", "excludes", "tolerance")
        if not self.denoise:
            raise ConflictError(("denoise", False), "does not go with", "tolerance")

    @property
    def falloffs(self) -> tuple[Falloff, ...]:
        """The falloffs that were given."""
        return self.falloff if isinstance(self.falloff, tuple) else (self.falloff,)

    @property
    def columns(self) -> int:
        """How many estimates there are of each w."""
        return len(self.falloffs) + len(_PROFILE) * self.profile

    def mus(self, radius: float) -> tuple[Mu, ...]:
        """The falloffs, then those of the profile, for a mesh of bounding-sphere radius `radius`."""
        return tuple(each.resolve(radius) for each in (*self.falloffs, *(_PROFILE if self.profile else ())))

    @property
    def identity(self) -> tuple[object, ...]:
        """Every option that can change a ray; μ, with lengths in mesh units, stands for the falloff."""
        values = {name: value for name, value in vars(self).items() if name not in _NO_RAYS}
        only = None if self.only is None else np.packbits(self.only).tobytes()
        return tuple((values | {"samples": self.rays, "only": only}).items())

    @property
    def rays(self) -> int:
        """Rays a vertex; the most, if there is a tolerance."""
        if self.samples is not None:
            return self.samples
        return DEFAULT_SAMPLES if self.tolerance is None else _MOST_FOR_TOLERANCE

    def rays_in_all(self, vertices: int) -> int:
        """Rays for so many vertices; the most, if there is a tolerance."""
        given = self.rays * vertices
        if self.method == "vertex" or self.samples is not None:
            return given
        return max(given, _FITTED if self.tolerance is None else _FITTED_FOR_TOLERANCE)
