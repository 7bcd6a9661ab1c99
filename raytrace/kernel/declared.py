"""The types that a kernel is compiled for: those that the annotations of its parameters name.

Arrays are C-contiguous, of one axis or of as many as `Annotated` says; numbers are int, float, bool or NumPy's; named
tuples have the types of their members; alternatives (`Layers | None`) are compiled one by one, with all of the others.
"""

from collections.abc import Callable, Iterator
from itertools import product
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np

_LENGTH = 4  # of an example's axes


def examples(annotated: Callable[..., Any]) -> dict[str, list[Any]]:
    """A value of each type that a kernel's parameters, or a named tuple's members, may have, by their names."""
    hints = get_type_hints(annotated, include_extras=True)
    return {name: list(_values(hint)) for name, hint in hints.items() if name != "return"}


def _values(hint: Any) -> Iterator[Any]:
    """A value of each type that an annotation names."""
    origin = get_origin(hint)
    if origin in (Union, UnionType):
        for alternative in get_args(hint):
            yield from _values(alternative)
    elif origin is Annotated:
        yield _array(*get_args(hint))
    elif origin is np.ndarray:
        yield _array(hint, 1)
    elif origin is tuple:
        yield from product(*map(_values, get_args(hint)))
    elif hasattr(hint, "_fields"):
        yield from (hint(*members) for members in product(*examples(hint).values()))
    else:
        yield None if hint is NoneType else hint(1)


def _array(hint: Any, axes: int) -> Any:
    """An array of the element type of an `NDArray`."""
    (element,) = get_args(get_args(hint)[1])
    return np.zeros((_LENGTH,) * axes, element)
