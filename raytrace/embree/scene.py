"""Embree scenes to trace rays in: triangles, and instances of other scenes."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Sequence

import numpy as np

from ..kernel.arrays import aligned
from ..types import AnyInts, Float32s
from .library import check, library
from .library import device as the_device

_TRIANGLE, _INSTANCE = 0, 121
_INDEX, _VERTEX = 0, 1
_UINT3, _FLOAT3, _FLOAT3X4_ROWS = 0x5003, 0x9003, 0x9134
_ROBUST = 1 << 2

_lock = threading.Lock()


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
            device = the_device()
            scene = library.rtcNewScene(device)
            check(device)
            self._release = weakref.finalize(self, library.rtcReleaseScene, scene)
            self._release.atexit = False
            library.rtcSetSceneFlags(scene, _ROBUST)
            for row, source in enumerate(self.geometries):
                geometry = source.geometry(device)
                library.rtcCommitGeometry(geometry)
                library.rtcAttachGeometryByID(scene, geometry, row)
                library.rtcReleaseGeometry(geometry)
            library.rtcCommitScene(scene)
            check(device)
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
