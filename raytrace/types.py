"""Names of array types, by element and number of axes; kernels are compiled for the types that their annotations name.

Where no kernel reads them, arrays of any number of axes go by the names of one axis. Those of kernels are C-contiguous,
of one axis or of as many as `Annotated` says; numbers are int, float, bool or NumPy's; named tuples have the types of
their members; alternatives (`Layers | None`) are compiled one by one, with all of the others.
"""

from collections.abc import Callable, Iterator
from itertools import product
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

Float64s = npt.NDArray[np.float64]
Float32s = npt.NDArray[np.float32]
Int64s = npt.NDArray[np.int64]
Int32s = npt.NDArray[np.int32]
UInt64s = npt.NDArray[np.uint64]
UInt32s = npt.NDArray[np.uint32]
UInt16s = npt.NDArray[np.uint16]
UInt8s = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]

Float64Rows = Annotated[Float64s, 2]
Float32Rows = Annotated[Float32s, 2]
Int64Rows = Annotated[Int64s, 2]
Int32Rows = Annotated[Int32s, 2]
UInt32Rows = Annotated[UInt32s, 2]
BoolRows = Annotated[Bools, 2]

Float64Grid = Annotated[Float64s, 3]
Float32Grid = Annotated[Float32s, 3]

AnyFloats = npt.NDArray[np.floating[Any]]
AnyInts = npt.NDArray[np.integer[Any]]

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
