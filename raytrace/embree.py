"""The interface to Embree: its C library, scenes to trace rays in, packets of rays for kernels, closest hits of arrays.

Nothing else imports embreex. Its extension module is linked to the Embree it ships, so opening that module with ctypes
resolves Embree's whole C API without guessing where a wheel keeps the library; to import it would bring Python's
logging, and take as long as to open it. Kernels get the addresses by name.

A packet is a float32 array (22, 8) or (22, 16), 64-byte aligned: the 12 rows of RTCRay8 or RTCRay16, the 9 rows of the
hit, and a row that is Embree's arguments of a query. Rows are named below; identifiers are the same memory viewed as
uint32.
"""

from __future__ import annotations

import ctypes
import sys
import threading
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .errors import EmbreeError, OptionError
from .kernel.arrays import aligned
from .kernel.jit import external, inline, kernel
from .kernel.library import provide
from .kernel.simd import rows_at
from .system.threads import run_blocks, thread_count
from .types import AnyInts, Float32Rows, Float32s, Int32s, Int64s

try:
    import embreex
except ImportError as failure:
    raise EmbreeError(
        f"embreex, which brings Embree, cannot be imported ({failure}): `python -m pip install embreex` installs it on "
        "x86-64 Linux with glibc, macOS 13 or later, and x86-64 Windows; elsewhere, as on ARM Linux, it has no wheel: "
        "build the Dockerfile's image with --platform linux/amd64 and run that"
    ) from failure

_VERSION_PROPERTY = 0

_Pointer, _Size, _Int = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (_Pointer, [ctypes.c_char_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_Pointer, _Int]),
    "rtcGetDeviceError": (_Int, [_Pointer]),
    "rtcGetDeviceLastErrorMessage": (ctypes.c_char_p, [_Pointer]),
    "rtcNewScene": (_Pointer, [_Pointer]),
    "rtcSetSceneFlags": (None, [_Pointer, _Int]),
    "rtcCommitScene": (None, [_Pointer]),
    "rtcReleaseScene": (None, [_Pointer]),
    "rtcNewGeometry": (_Pointer, [_Pointer, _Int]),
    "rtcSetSharedGeometryBuffer": (None, [_Pointer, _Int, ctypes.c_uint, _Int, _Pointer, _Size, _Size, _Size]),
    "rtcCommitGeometry": (None, [_Pointer]),
    "rtcReleaseGeometry": (None, [_Pointer]),
    "rtcAttachGeometryByID": (None, [_Pointer, _Pointer, ctypes.c_uint]),
    "rtcSetGeometryInstancedScene": (None, [_Pointer, _Pointer]),
    "rtcSetGeometryTransform": (None, [_Pointer, ctypes.c_uint, _Int, _Pointer]),
}
_QUERIES = ("rtcIntersect8", "rtcOccluded8", "rtcIntersect16", "rtcOccluded16", "rtcPointQuery")
_TRIANGLE, _INSTANCE = 0, 121
_INDEX, _VERTEX = 0, 1
_UINT3, _FLOAT3, _FLOAT3X4_ROWS = 0x5003, 0x9003, 0x9134
_ROBUST = 1 << 2
_lock = threading.Lock()

LANES = 8
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = range(12)
NG_X, NG_Y, NG_Z, U, V, PRIM_ID, GEOM_ID, INST_ID, INST_PRIM_ID = range(12, 21)
ARGUMENTS = 21
INVALID = np.uint32(0xFFFFFFFF)
_COHERENT = 1 << 16
_INVOKE_FILTER = 1 << 1
CONTEXT, ROOM, END = 22, 23, 42  # rows of packets with a filter: Embree's context, and what the filter may write to
FILTER_PATH = 2, 1  # from what Embree gives a filter to the words of its `Kernel.callback`
_BLOCK, _MOST = 1 << 12, 16  # rays, and blocks at once


def _open_library() -> ctypes.CDLL:
    """Load embreex's Embree with the types of its C functions, and hand queries to kernels. Raises: EmbreeError."""
    if sys.platform == "win32":
        import_module("embreex.rtcore_scene")  # which loads it
        library = ctypes.CDLL("embree4.dll")
    else:
        library = ctypes.CDLL(str(next(Path(embreex.__path__[0]).glob("rtcore_scene.*.so"))))
    try:
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        for name in _QUERIES:
            provide(name, ctypes.cast(getattr(library, name), _Pointer).value or 0)
    except AttributeError as missing:
        raise EmbreeError(f"embreex: Embree library: expected version 4 with all of its C API, got {missing}") from None
    return library


library = _open_library()


@cache
def device() -> int:
    """The process's one Embree device."""
    device = library.rtcNewDevice(None)
    if not device:
        raise EmbreeError(f"Embree device: {_last_message(None)}")
    check_version(library.rtcGetDeviceProperty(device, _VERSION_PROPERTY))
    return int(device)


def check_version(number: int) -> None:
    """Check that a version number, such as 40303, is of an Embree 4. Raises: EmbreeError."""
    if number // 10000 != 4:
        raise EmbreeError(f"embreex: Embree version: expected 4.x, got {number // 10000}.{number // 100 % 100}")


def version() -> str:
    """Embree's own version, such as '4.4.0'."""
    number = library.rtcGetDeviceProperty(device(), _VERSION_PROPERTY)
    return f"{number // 10000}.{number // 100 % 100}.{number % 100}"


def _last_message(device: int | None) -> str:
    """Embree's message about the last error of a device; of None, about the creation of a device."""
    text = library.rtcGetDeviceLastErrorMessage(device)
    return text.decode(errors="replace") if text else "unknown error"


def check(device: int) -> None:
    """Check that no call to Embree on this device has failed. Raises: EmbreeError."""
    if library.rtcGetDeviceError(device):
        raise EmbreeError(f"Embree: {_last_message(device)}")


class Triangles:
    """Vertex and index buffers as Embree shares them: copies of `vertices` (n, 3), finite, and `faces` (m, 3)."""

    def __init__(self, vertices: Float32s, faces: AnyInts) -> None:
        self.vertices = aligned(vertices.shape, np.float32)
        self.vertices[:] = vertices
        self.faces = aligned(faces.shape, np.uint32)
        self.faces[:] = faces

    def geometry(self, device: int) -> int:
        """A new, uncommitted Embree geometry; keep `self` alive as long as it."""
        geometry: int = library.rtcNewGeometry(device, _TRIANGLE)
        for kind, layout, data in ((_VERTEX, _FLOAT3, self.vertices), (_INDEX, _UINT3, self.faces)):
            library.rtcSetSharedGeometryBuffer(geometry, kind, 0, layout, data.ctypes.data, 0, 12, len(data))
        return geometry


class EmbreeInstance:
    """A scene placed inside another, to whose coordinates the `matrix`, float32 (3, 4), takes its own."""

    def __init__(self, scene: EmbreeScene, matrix: Float32s) -> None:
        self.scene = scene
        self.matrix = np.ascontiguousarray(matrix, np.float32)

    def geometry(self, device: int) -> int:
        """A new, uncommitted Embree geometry; keep `self` alive as long as it."""
        geometry: int = library.rtcNewGeometry(device, _INSTANCE)
        library.rtcSetGeometryInstancedScene(geometry, int(self.scene.handle))
        library.rtcSetGeometryTransform(geometry, 0, _FLOAT3X4_ROWS, self.matrix.ctypes.data)
        return geometry


class EmbreeScene:
    """Triangles and instances in an Embree scene, robust mode; `handle` is what kernels trace in.

    A hit's GEOM_ID is the row in `geometries`, or 0 inside an instance whose row is INST_ID.
    Raises: EmbreeError: Embree reports an error, out of memory for instance.
    """

    def __init__(self, geometries: Sequence[Triangles | EmbreeInstance]) -> None:
        self.geometries = tuple(geometries)
        with _lock:
            the_device = device()
            scene = library.rtcNewScene(the_device)
            check(the_device)
            self._release = weakref.finalize(self, library.rtcReleaseScene, scene)
            self._release.atexit = False
            library.rtcSetSceneFlags(scene, _ROBUST)
            for row, source in enumerate(self.geometries):
                geometry = source.geometry(the_device)
                library.rtcCommitGeometry(geometry)
                library.rtcAttachGeometryByID(scene, geometry, row)
                library.rtcReleaseGeometry(geometry)
            library.rtcCommitScene(scene)
            check(the_device)
        self.handle = np.uint64(scene)

    def release(self) -> None:
        """Give Embree's memory back; nothing can be traced in the scene any more."""
        self._release()
        self.geometries = ()
        self.handle = np.uint64(0)


class TriangleScene(EmbreeScene):
    """An Embree scene of one set of triangles; arguments as `Triangles`, errors as `EmbreeScene`."""

    def __init__(self, vertices: Float32s, faces: AnyInts) -> None:
        super().__init__([Triangles(vertices, faces)])


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


@dataclass(frozen=True, eq=False)
class Hits:
    """Closest hits of k rays: `distance` in units of the ray's direction, `face` as row of the scene's, `barycentric`
    weights (k, 3) of its corners; inf, −1 and 0 for a miss."""

    distance: Float32s
    face: Int64s
    barycentric: Float32s


@kernel
def _closest(
    scene: np.uint64,
    traced: tuple[Float32Rows, Int32s],
    rays: tuple[Float32Rows, Float32Rows, Float32s],
    hits: tuple[Float32s, Int64s, Float32Rows],
    begin: int,
    end: int,
) -> None:
    """Trace the rays from `begin` to `end` in packets of eight, and write what they hit.

    Args:
        traced: of `new_packet`.
        rays: origins (k, 3), directions (k, 3), reach (k,).
        hits: arrays as of `Hits`, written.
    """
    (packet, valid), (origins, directions, reach), (distance, face, barycentric) = traced, rays, hits
    ids = packet.view(np.uint32)
    for first_ray in range(begin, end, LANES):
        for lane in range(LANES):
            ray = min(first_ray + lane, end - 1)
            valid[lane] = -1 if first_ray + lane < end else 0
            for axis in range(3):
                packet[ORG_X + axis, lane] = origins[ray, axis]
                packet[DIR_X + axis, lane] = directions[ray, axis]
            packet[TFAR, lane] = reach[ray]
        intersect8(scene, packet, valid)
        for lane in range(min(LANES, end - first_ray)):
            if ids[GEOM_ID, lane] != INVALID:
                ray = first_ray + lane
                distance[ray] = packet[TFAR, lane]
                face[ray] = ids[PRIM_ID, lane]
                u = packet[U, lane]
                v = packet[V, lane]
                barycentric[ray, 0] = np.float32(1.0) - u - v
                barycentric[ray, 1] = u
                barycentric[ray, 2] = v


def intersect(
    scene: TriangleScene, origins: Any, directions: Any, reach: Any = np.inf, threads: int | None = None
) -> Hits:
    """Closest hits of rays with 0 ≤ distance ≤ reach.

    Args: origins, directions: broadcast to (k, 3), rounded to float32; scene units; directions of any length but zero.
        reach: broadcasts to (k,), in units of the direction's length.
    Raises: OptionError: wrong shapes, or values that Embree would take for a miss: NaN, infinity, zero directions.
    """
    origins, directions = np.broadcast_arrays(origins, directions)
    origins = np.ascontiguousarray(origins, np.float32)
    directions = np.ascontiguousarray(directions, np.float32)
    if origins.ndim != 2 or origins.shape[1] != 3:
        raise OptionError("origins, directions", "shapes that broadcast to (k, 3)", origins.shape)
    if not (np.isfinite(origins).all() and np.isfinite(directions).all() and directions.any(axis=1).all()):
        raise OptionError("origins, directions", "finite origins and finite directions that are not zero", "others")
    count = len(origins)
    rays = origins, directions, np.ascontiguousarray(np.broadcast_to(np.float32(reach), count))
    hits = np.full(count, np.inf, np.float32), np.full(count, -1), np.zeros((count, 3), np.float32)

    def work(start: int, stop: int) -> None:
        _closest(scene.handle, new_packet(), rays, hits, start, stop)

    run_blocks(count, _BLOCK, work, thread_count(threads), most=_MOST)
    return Hits(*hits)
