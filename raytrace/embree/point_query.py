"""Faces near a point, from Embree's own hierarchy: a point query whose callback notes the faces that it visits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

from ..kernel.arrays import aligned
from ..kernel.jit import callback, inline
from ..types import Float32s, Int64s, UInt32s
from . import library as library  # LLVM knows Embree's functions from then on
from .packets import INVALID
from .scene import TriangleScene

_point_query = types.ExternalFunction("rtcPointQuery", types.boolean(*(types.uintp,) * 5))
HEAD = 2  # numbers before the rows: how many there are, the capacity
_PRIM_ID = 2  # RTCPointQueryFunctionArguments: query, userPtr, then primID and geomID in one word
_USER = 1
_INSTANCES = 32  # RTCPointQueryContext: two matrices, then the instances' identifiers


@intrinsic
def _array_at(_typing: Any, address: Any) -> Any:
    """The int64 array at an address."""
    pointer = types.CPointer(types.int64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(pointer))

    return pointer(address), generate


@callback(types.boolean(types.CPointer(types.int64)))
def _note(arguments):
    """Note a face's row, or only count it where the array is full."""
    given = numba.carray(arguments, 3)
    head = numba.carray(_array_at(given[_USER]), HEAD)
    if head[0] < head[1]:
        numba.carray(_array_at(given[_USER]), HEAD + head[1])[HEAD + head[0]] = given[_PRIM_ID] & 0xFFFFFFFF
    head[0] += 1
    return False


NOTE = int(_note.address)


class PointQuery(NamedTuple):
    """A scene to query, Embree's arguments, and an array for the answer; an argument of kernels.

    Attributes:
        scene: uint64, handle of a TriangleScene. note: `NOTE`, which no cached kernel may hold.
        query: float32 (8,), context: uint32 (64,), aligned scratch.
        near: int64 (HEAD + capacity,), the answer: how many faces were found, the capacity, then rows of faces.
    """

    scene: np.uint64
    note: int
    query: Float32s
    context: UInt32s
    near: Int64s

    @classmethod
    def of(cls, scene: TriangleScene, capacity: int) -> PointQuery:
        """Queries of `scene` for up to so many faces."""
        near = np.empty(HEAD + capacity, np.int64)
        return cls(scene.handle, NOTE, aligned((8,), np.float32), aligned((64,), np.uint32), near)


@inline
def faces_near(search, point, radius):
    """Write the rows of all faces within `radius` of a point, and of some farther ones, into search.near[HEAD:].

    Returns their number; those beyond the capacity are only counted.
    Args: search: PointQuery. point: triple of float64.
    """
    query, context, near = search.query, search.context, search.near
    near[0], near[1] = 0, len(near) - HEAD
    query[0], query[1], query[2], query[3], query[4] = point[0], point[1], point[2], 0.0, radius
    context[_INSTANCES], context[_INSTANCES + 1] = INVALID, INVALID
    _point_query(search.scene, query.ctypes.data, context.ctypes.data, search.note, near.ctypes.data)
    return near[0]
