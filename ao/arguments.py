"""What the bakers accept, checked before any work is done."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator

from raytrace.errors import MeshError, OptionError, nearest_name
from raytrace.mesh.mesh import Mesh
from raytrace.system.parameters import Parameters, Seed, Whole
from raytrace.system.threads import thread_count

from .falloff import Binary, Exponential, Falloff

MAX_SAMPLES = 1 << 20


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


def _thread_count(threads: int | None) -> int | None:
    thread_count(threads)
    return threads


Hidden = Annotated[Literal["auto", "ignore", "mark", "fill"], Field(description="auto, ignore, mark or fill")]
Samples = Annotated[Whole, Field(ge=1, le=MAX_SAMPLES)]
Tolerance = Annotated[float, Field(strict=True, ge=1e-5, le=1, description="a number from 1e-5 to 1")]


class BakeOptions(Parameters, source="options"):
    """How a mesh is baked, as `ao.bake` explains it.

    Attributes:
        falloff: μ, or its name.
        samples: rays a vertex, 1 to 2²⁰; None: as many as the method takes by default.
        seed: 0 to 2⁶⁴ − 1.
        threads: None for all cores.
        tolerance: root mean square error of w to bake to, 1e-5 to 1, or None.
        reconstruct: whether estimates are shrunk towards a prediction from their neighbours.
        hidden: vertices inside closed solids: "auto", "ignore", "mark" or "fill".
        skip: whether rays that provably hit nothing are left out.

    Raises:
        OptionError: a value is out of range, or two don't go together.
    """

    falloff: Annotated[Falloff, PlainValidator(falloff_of)] = Exponential()
    samples: Samples | None = None
    seed: Seed = 0
    threads: Annotated[int | None, PlainValidator(_thread_count)] = None
    tolerance: Tolerance | None = None
    reconstruct: bool = True
    hidden: Hidden = "auto"
    skip: bool = True

    def __post_init__(self) -> None:
        if self.tolerance is not None and not self.reconstruct:
            raise OptionError("reconstruct", "reconstruction together with a tolerance", "none")


def check_arguments(
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    tolerance: float | None = None,
    reconstruct: bool = True,
    hidden: Hidden = "ignore",
    only: Any = None,
) -> None:
    """Refuse arguments of `ao.bake` that are out of range or don't go together. Raises: OptionError."""
    BakeOptions(
        samples=samples, seed=seed, threads=threads, tolerance=tolerance, reconstruct=reconstruct, hidden=hidden
    )
    if only is not None and tolerance is not None:
        raise OptionError("only", "no mask of vertices together with a tolerance", "both")


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
