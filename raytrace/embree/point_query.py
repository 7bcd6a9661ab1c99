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
from .scene import EmbreeScene, TriangleScene

_point_query = types.ExternalFunction("rtcPointQuery", types.boolean(*(types.uintp,) * 5))
HEAD = 2  # numbers before the rows: how many there are, the capacity
_USER, _IDS, _CONTEXT = 1, 2, 3  # words of RTCPointQueryFunctionArguments; primID and geomID are one
_INSTANCES = 32  # RTCPointQueryContext: two matrices, then the instances' identifiers, one of which is in use
_LOW = 0xFFFFFFFF


@intrinsic
def _array_at(_typing: Any, address: Any) -> Any:
    """The int64 array at an address."""
    pointer = types.CPointer(types.int64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(pointer))

    return pointer(address), generate


@callback(types.boolean(types.CPointer(types.int64)))
def _note(arguments):
    """Note a face's row in its geometry, and above that the geometry's, or only count it where the array is full."""
    given = numba.carray(arguments, 4)
    head = numba.carray(_array_at(given[_USER]), HEAD)
    if head[0] < head[1]:
        instance = numba.carray(_array_at(given[_CONTEXT]), _INSTANCES // 2 + 1)[_INSTANCES // 2] & _LOW
        ids = given[_IDS] if instance == _LOW else (given[_IDS] & _LOW) | (instance << 32)
        numba.carray(_array_at(given[_USER]), HEAD + head[1])[HEAD + head[0]] = ids
    head[0] += 1
    return False


NOTE = int(_note.address)


class JoinedScene(TriangleScene):
    """Several geometries of a scene that is built already, as one set of triangles to be queried.

    Args:
        scene: kept as long as this.
        starts: int64 (g,), the number of the first face of each of its geometries; an instance counts as one.
        rows: int64 (f,), the row of each face in the one set, by its number; −1 for those left out.
        away: by which the set's coordinates exceed those of `scene`.
    """

    def __init__(self, scene: EmbreeScene, starts: Int64s, rows: Int64s, away: float) -> None:
        self.scene, self.handle, self.geometries, self.seconds = scene, scene.handle, scene.geometries, 0.0
        self.starts, self.rows, self.away = starts, rows, away


class PointQuery(NamedTuple):
    """A scene to query, Embree's arguments, and an array for the answer; an argument of kernels.

    Attributes:
        scene: uint64, handle of a TriangleScene. note: `NOTE`, which no cached kernel may hold.
        query: float32 (8,), context: uint32 (64,), aligned scratch.
        near: int64 (HEAD + capacity,), the answer: how many faces were found, the capacity, then rows of faces.
        starts, rows, away: of a `JoinedScene`; no rows for another, whose only geometry's they are.
    """

    scene: np.uint64
    note: int
    query: Float32s
    context: UInt32s
    near: Int64s
    starts: Int64s
    rows: Int64s
    away: float

    @classmethod
    def of(cls, scene: TriangleScene, capacity: int) -> PointQuery:
        """Queries of `scene` for up to so many faces."""
        query, context = aligned((8,), np.float32), aligned((64,), np.uint32)
        near, none = np.empty(HEAD + capacity, np.int64), np.empty(0, np.int64)
        joined = (scene.starts, scene.rows, scene.away) if isinstance(scene, JoinedScene) else (none, none, 0.0)
        return cls(scene.handle, NOTE, query, context, near, *joined)


@inline
def faces_near(search, point, radius):
    """Write the rows of all faces within `radius` of a point, and of some farther ones, into search.near[HEAD:].

    Returns their number; those beyond the capacity are only counted.
    Args: search: PointQuery. point: triple of float64.
    """
    query, context, near = search.query, search.context, search.near
    near[0], near[1] = 0, len(near) - HEAD
    for axis in range(3):
        query[axis] = point[axis] - search.away
    query[3], query[4] = 0.0, radius
    context[_INSTANCES], context[_INSTANCES + 1] = INVALID, INVALID
    _point_query(search.scene, query.ctypes.data, context.ctypes.data, search.note, near.ctypes.data)
    if len(search.rows) == 0:
        return near[0]
    kept = HEAD
    for k in range(HEAD, HEAD + min(near[0], near[1])):
        row = search.rows[search.starts[near[k] >> 32] + (near[k] & _LOW)]
        near[k] = 0
        near[kept] = max(row, 0)
        kept += row >= 0
    return kept - HEAD if near[0] <= near[1] else near[0]
