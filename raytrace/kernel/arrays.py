"""Arrays for kernels and Embree: aligned, viewed without reference counting, multiplied without BLAS.

OpenBLAS multiplies a few thousand rows on threads that go on spinning for some thirty milliseconds afterwards, on
cores that rays are traced on meanwhile: bakes take up to twice as long.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ..types import AnyFloats, Float64s
from .jit import arrayobj, cgutils, intrinsic, lanes, types


def product(rows: Float64s, matrix: AnyFloats) -> Float64s:
    """rows (n, k) · matrix (k,) or (k, m): (n,) or (n, m)."""
    return np.asarray(np.einsum("nk,k...->n...", rows, matrix))


def aligned(shape: tuple[int, ...], dtype: npt.DTypeLike, zeroed: bool = True) -> npt.NDArray[Any]:
    """Array of zeros, or of anything, that starts on a 64-byte boundary and owns 16 spare bytes, as Embree wants."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = (np.zeros if zeroed else np.empty)(size + 80, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size].view(dtype).reshape(shape)


def _uncounted(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """LLVM's value as it is, but with arrays that own nothing, whose references are not counted."""
    if isinstance(kind, types.BaseTuple):
        members = [builder.extract_value(value, position) for position in range(len(kind.types))]
        views = [_uncounted(context, builder, *typed) for typed in zip(kind.types, members, strict=True)]
        return context.make_tuple(builder, kind, views)
    if not isinstance(kind, types.Array):
        return value
    array = arrayobj.make_array(kind)(context, builder, value)
    array.meminfo = cgutils.get_null_value(array.meminfo.type)
    array.parent = cgutils.get_null_value(array.parent.type)
    return array._getvalue()


@intrinsic(lambda value: lanes.view_type(value)(value))
def unrefcounted_view(context, builder, signature, value):
    """`value`, an array, a named tuple of arrays, scalars and such tuples, or None, as views that own nothing.

    Taking a member of a tuple or a slice of an array counts a reference up and down, atomically. A kernel's arguments
    outlive it, so it takes views of them once, at its beginning, and every later count is left out. Of a named tuple
    it gets the address: only `value.name` is left of it, and functions that it is passed to are small to compile.
    """
    (kind,), view = signature.args, _uncounted(context, builder, signature.args[0], value)
    if signature.return_type == kind:
        return view
    return builder.bitcast(cgutils.alloca_once_value(builder, view), cgutils.voidptr_t)
