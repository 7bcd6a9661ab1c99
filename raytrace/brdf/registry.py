"""Reflection models: each registers its class of materials and its kernels by the decorator `reflection_model`."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, TypeVar
from zlib import crc32

from ..errors import OptionError
from ..kernel.jit import inline
from ..kernel.library import compare_sources
from .material import Material

M = TypeVar("M", bound=type[Material])
_MODELS: dict[str, type[Material]] = {}


def reflection_model(terms: Any, terms_in_lanes: Any = None) -> Callable[[M], M]:
    """Decorator of a class of materials, whose field `model` has its name in scene files.

    Args:
        terms: an `inline` helper (row, n, l, v, grain): the diffuse and the specular RGB that a packed row reflects of
            unit incident RGB, for n·l > 0; unit vectors n, l, v away from the surface, `grain` of brushed materials.
        terms_in_lanes: the same of SIMD lanes of float32, which takes the mask of the lanes that are wanted, too;
            `in_lanes(terms)` where `terms` does without branches by lanes. Without it `terms` is called lane by lane.

    Raises: OptionError: the name is taken, or a material has been read or reflected, for which kernels were made.
    """

    def register(material: M) -> M:
        """The class, registered under its name with a kind that its packed rows carry. Raises: OptionError."""
        name: str = material.model  # type: ignore[attr-defined]
        if name in _MODELS or reflection_models.cache_info().currsize:
            expected = "a name of its own, and models before the first use of any"
            raise OptionError("model", expected, repr(name), material.__name__)
        material.kind = crc32(name.encode())
        material.terms = terms
        material.terms_in_lanes = terms_in_lanes
        _MODELS[name] = material
        if not material.__module__.startswith(f"{__package__}."):
            compare_sources()  # kernels with this model are compiled by Numba
        return material

    return register


def in_lanes(terms: Any) -> Any:
    """`terms` as `terms_in_lanes`, for a model without branches (`raytrace.kernel.simd.select` in their place)."""

    @inline
    def unmasked(row, n, l, v, grain, wanted):
        return terms(row, n, l, v, grain)

    return unmasked


@cache
def reflection_models() -> tuple[type[Material], ...]:
    """All models by their names: those of `raytrace/brdf/models/`, and those that a program has registered."""
    package = import_module(f"{__package__}.models")
    for file in iter_modules(package.__path__):
        import_module(f"{package.__name__}.{file.name}")
    return tuple(_MODELS[name] for name in sorted(_MODELS))
