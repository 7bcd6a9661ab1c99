"""Packets of rays, and the queries that kernels call for them.

A packet is a float32 array (22, 8) or (22, 16), 64-byte aligned: the 12 rows of RTCRay8 or RTCRay16, the 9 rows of the
hit, and a row that is Embree's arguments of a query. Rows are named below; identifiers are the same memory viewed as
uint32.
"""

from typing import Any

import numpy as np

from ..kernel.arrays import aligned
from ..kernel.jit import external, inline
from ..kernel.simd import rows_at
from ..types import Float32s, Int32s, Int64s
from . import library as library  # kernels can call Embree's functions from then on

LANES = 8
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = range(12)
NG_X, NG_Y, NG_Z, U, V, PRIM_ID, GEOM_ID, INST_ID, INST_PRIM_ID = range(12, 21)
ARGUMENTS = 21
INVALID = np.uint32(0xFFFFFFFF)
_COHERENT = 1 << 16
_INVOKE_FILTER = 1 << 1
CONTEXT, ROOM, END = 22, 23, 42  # rows of packets with a filter: Embree's context, and what the filter may write to
FILTER_PATH = 2, 1  # from what Embree gives a filter to the words of its `Kernel.callback`


def _queries(lanes: int) -> tuple[Any, Any]:
    """The queries of packets of so many lanes; of int32 lanes `valid`, aligned, −1 are traced and 0 not."""
    closest_hits = external(f"rtcIntersect{lanes}")
    any_hits = external(f"rtcOccluded{lanes}")
    arguments_at = ARGUMENTS * lanes * 4

    @inline
    def intersect(scene, packet, valid):
        """Closest hit of each valid lane: overwrites TFAR and the rows of the hit; GEOM_ID is INVALID on a miss."""
        ids = packet.view(np.uint32)
        for lane in range(lanes):
            ids[GEOM_ID, lane] = INVALID
            ids[INST_ID, lane] = INVALID
        closest_hits(valid.ctypes.data, scene, packet.ctypes.data, packet.ctypes.data + arguments_at)

    @inline
    def occluded(scene, packet, valid):
        """Any hit of each valid lane: TFAR of `packet` becomes −inf where something stands in the way."""
        any_hits(valid.ctypes.data, scene, packet.ctypes.data, packet.ctypes.data + arguments_at)

    return intersect, occluded


intersect8, occluded8 = _queries(8)
intersect16, occluded16 = _queries(16)


@inline
def filtered(call):
    """The arguments of Embree's filter function, which is called for packets of sixteen rays with the address
    `call`.

    Of k hits: the mask, int32 (k,), to be set to 0 where one is rejected; rays, float32 (12, k); hits, (9, k), the rows
    from NG_X on; and the packet.
    """
    # RTCFilterFunctionNArguments: valid, user pointer, context, rays, hits, N; the packet is before the context.
    given = rows_at(call, 1, 12).view(np.int64)[0]
    count = given[5] & 0xFFFFFFFF
    packet = rows_at(given[2] - CONTEXT * 2 * LANES * 4, END, 2 * LANES)
    valid = rows_at(given[0], 1, count).view(np.int32)[0]
    return valid, rows_at(given[3], 12, count), rows_at(given[4], 9, count), packet


def new_packet(
    lanes: int = LANES, coherent: bool = False, hit_filter: tuple[int, Int64s] | None = None
) -> tuple[Float32s, Int32s]:
    """A packet ready for tracing from tnear 0 with no mask, and its `valid` lanes, all on.

    Args: lanes: 8 or 16. coherent: whether its rays will run closely side by side, as a camera's do.
        hit_filter: a `Kernel.callback` that Embree calls at each hit of sixteen lanes; it is to be kept meanwhile.
    """
    packet = aligned((ARGUMENTS + 1 if hit_filter is None else END, lanes), np.float32)
    ids = packet.view(np.uint32)
    words = packet.view(np.int64)
    ids[MASK] = INVALID
    ids[ARGUMENTS, :2] = (_COHERENT if coherent else 0), INVALID  # flags, features
    if hit_filter is not None:
        ids[ID], ids[CONTEXT, :2] = np.arange(lanes), INVALID
        ids[ARGUMENTS, 0] |= _INVOKE_FILTER
        words[ARGUMENTS, 1:3] = packet[CONTEXT].ctypes.data, hit_filter[0]
        words[CONTEXT, 1] = hit_filter[1].ctypes.data
    valid = aligned((lanes,), np.int32)
    valid[:] = -1
    return packet, valid
