"""Embree 4 behind two doors: functions that kernels call, and one scene of triangles for everybody else.

The only importer of embreex. Its extension module is linked to the Embree it ships, so opening that module with
ctypes resolves Embree's whole C API without guessing where a wheel keeps the library. The addresses are handed to
LLVM by name, which keeps compiled kernels valid in the next process.

A packet is a float32 array (22, 8) or (22, 16), 64-byte aligned: the 12 rows of RTCRay8 or RTCRay16, the 9 rows of the
hit, and a row that is Embree's arguments of a query. Rows are named below; identifiers are the same memory viewed as
uint32.
"""

from __future__ import annotations

import ctypes
import math
import sys
import threading
import time
import weakref
from collections.abc import Sequence
from functools import cache
from typing import Any

import embreex.rtcore_scene
import llvmlite.binding
import numpy as np
import numpy.typing as npt
from numba import types

from .errors import EmbreeError
from .jit import inline

LANES = 8
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = range(12)
NG_X, NG_Y, NG_Z, U, V, PRIM_ID, GEOM_ID, INST_ID, INST_PRIM_ID = range(12, 21)
ARGUMENTS = 21
_ARGUMENTS_AT = ARGUMENTS * LANES * 4
INVALID = np.uint32(0xFFFFFFFF)

_TRIANGLE, _INSTANCE = 0, 121
_INDEX, _VERTEX = 0, 1
_UINT3, _FLOAT3, _FLOAT3X4_ROWS = 0x5003, 0x9003, 0x9134
_ROBUST = 1 << 2
_COHERENT = 1 << 16
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


def _open_library() -> ctypes.CDLL:
    path = "embree4.dll" if sys.platform == "win32" else embreex.rtcore_scene.__file__
    library = ctypes.CDLL(path)
    try:
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        for name in _QUERIES:
            address = ctypes.cast(getattr(library, name), _Pointer).value
            llvmlite.binding.add_symbol(name, address)
    except AttributeError as missing:
        raise EmbreeError(f"embreex: Embree library: expected version 4 with all of its C API, got {missing}") from None
    return library


_library = _open_library()
_call = types.void(types.uintp, types.uintp, types.uintp, types.uintp)
_intersect8 = types.ExternalFunction("rtcIntersect8", _call)
_occluded8 = types.ExternalFunction("rtcOccluded8", _call)
_intersect16 = types.ExternalFunction("rtcIntersect16", _call)
_occluded16 = types.ExternalFunction("rtcOccluded16", _call)
point_query = types.ExternalFunction("rtcPointQuery", types.boolean(*(types.uintp,) * 5))  # see raytrace.nearby


@inline
def intersect8(scene, packet, valid):
    """Closest hit of each valid lane: overwrites TFAR and the hit rows of `packet`; GEOM_ID is INVALID on a miss.

    Args: scene: handle, uint64. packet: float32 (22, 8), aligned. valid: int32 (8,), aligned, −1 traced, 0 not.
    """
    ids = packet.view(np.uint32)
    for lane in range(LANES):
        ids[GEOM_ID, lane] = INVALID
        ids[INST_ID, lane] = INVALID
    _intersect8(valid.ctypes.data, scene, packet.ctypes.data, packet.ctypes.data + _ARGUMENTS_AT)


@inline
def occluded8(scene, packet, valid):
    """Any hit of each valid lane: TFAR of `packet` becomes −inf where something stands in the way."""
    _occluded8(valid.ctypes.data, scene, packet.ctypes.data, packet.ctypes.data + _ARGUMENTS_AT)


@inline
def intersect16(scene, packet, valid):
    """`intersect8` of sixteen lanes."""
    ids = packet.view(np.uint32)
    for lane in range(2 * LANES):
        ids[GEOM_ID, lane] = INVALID
        ids[INST_ID, lane] = INVALID
    _intersect16(valid.ctypes.data, scene, packet.ctypes.data, packet.ctypes.data + 2 * _ARGUMENTS_AT)


@inline
def occluded16(scene, packet, valid):
    """`occluded8` of sixteen lanes."""
    _occluded16(valid.ctypes.data, scene, packet.ctypes.data, packet.ctypes.data + 2 * _ARGUMENTS_AT)


def aligned(shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Zeroed array that starts on a 64-byte boundary and owns 16 spare bytes behind its end, as Embree wants."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = np.zeros(size + 80, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size].view(dtype).reshape(shape)


def new_packet(lanes: int = LANES, coherent: bool = False) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """A packet ready for tracing from tnear 0 with no mask, and its `valid` lanes, all on.

    Args: lanes: 8 or 16. coherent: whether its rays will run closely side by side, as a camera's do.
    """
    packet = aligned((22, lanes), np.float32)
    ids = packet.view(np.uint32)
    ids[MASK] = INVALID
    ids[ARGUMENTS, :2] = (_COHERENT if coherent else 0), INVALID  # flags, features
    valid = aligned((lanes,), np.int32)
    valid[:] = -1
    return packet, valid


_lock = threading.Lock()


@cache
def _device() -> int:
    """The process's one Embree device."""
    device = _library.rtcNewDevice(None)
    if not device:
        raise EmbreeError(f"Embree device: {_last_message(None)}")
    version = _library.rtcGetDeviceProperty(device, _VERSION_PROPERTY)
    if version // 10000 != 4:
        raise EmbreeError(f"embreex: Embree version: expected 4.x, got {version // 10000}.{version // 100 % 100}")
    return int(device)


def version() -> str:
    """Embree's own version, such as '4.4.0'."""
    number = _library.rtcGetDeviceProperty(_device(), _VERSION_PROPERTY)
    return f"{number // 10000}.{number // 100 % 100}.{number % 100}"


def _last_message(device: int | None) -> str:
    text = _library.rtcGetDeviceLastErrorMessage(device)
    return text.decode(errors="replace") if text else "unknown error"


def _check(device: int) -> None:
    if _library.rtcGetDeviceError(device):
        raise EmbreeError(f"Embree: {_last_message(device)}")


class Triangles:
    """Vertex and index buffers as Embree shares them.

    Args:
        vertices: float32 (n, 3), finite. faces: integer (m, 3), indices into `vertices`. Both are copied once.
    """

    def __init__(self, vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.integer[Any]]) -> None:
        self.vertices = aligned(vertices.shape, np.float32)
        self.vertices[:] = vertices
        self.faces = aligned(faces.shape, np.uint32)
        self.faces[:] = faces

    def geometry(self, device: int) -> int:
        """A new, uncommitted Embree geometry; keep `self` alive as long as it."""
        made: int = _library.rtcNewGeometry(device, _TRIANGLE)
        for kind, layout, data in ((_VERTEX, _FLOAT3, self.vertices), (_INDEX, _UINT3, self.faces)):
            _library.rtcSetSharedGeometryBuffer(made, kind, 0, layout, data.ctypes.data, 0, 12, len(data))
        return made


class Instance:
    """A scene placed inside another.

    Args:
        scene: what is placed. matrix: float32 (3, 4), its coordinates to the outer scene's.
    """

    def __init__(self, scene: EmbreeScene, matrix: npt.NDArray[np.float32]) -> None:
        self.scene = scene
        self.matrix = np.ascontiguousarray(matrix, np.float32)

    def geometry(self, device: int) -> int:
        """A new, uncommitted Embree geometry; keep `self` alive as long as it."""
        made: int = _library.rtcNewGeometry(device, _INSTANCE)
        _library.rtcSetGeometryInstancedScene(made, int(self.scene.handle))
        _library.rtcSetGeometryTransform(made, 0, _FLOAT3X4_ROWS, self.matrix.ctypes.data)
        return made


class EmbreeScene:
    """Triangles and instances in an Embree scene, robust mode.

    A hit's GEOM_ID is the row in `geometries`, or 0 inside an instance whose row is INST_ID.

    Attributes:
        handle: what kernels trace in. seconds: how long it took to build.

    Raises:
        EmbreeError: Embree reports an error, out of memory for instance.
    """

    def __init__(self, geometries: Sequence[Triangles | Instance]) -> None:
        self.geometries = tuple(geometries)
        start = time.perf_counter()
        with _lock:
            device = _device()
            scene = _library.rtcNewScene(device)
            _check(device)
            self._release = weakref.finalize(self, _library.rtcReleaseScene, scene)
            self._release.atexit = False
            _library.rtcSetSceneFlags(scene, _ROBUST)
            for row, source in enumerate(self.geometries):
                geometry = source.geometry(device)
                _library.rtcCommitGeometry(geometry)
                _library.rtcAttachGeometryByID(scene, geometry, row)
                _library.rtcReleaseGeometry(geometry)
            _library.rtcCommitScene(scene)
            _check(device)
        self.handle = np.uint64(scene)
        self.seconds = time.perf_counter() - start


class TriangleScene(EmbreeScene):
    """An Embree scene of one set of triangles; arguments as `Triangles`, errors as `EmbreeScene`."""

    def __init__(self, vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.integer[Any]]) -> None:
        super().__init__([Triangles(vertices, faces)])
