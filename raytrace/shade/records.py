"""Records that kernels read a scene from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


class Geometry(NamedTuple):
    """Arrays for kernels; rows of `objects` columns are a scene's objects, in order.

    Attributes:
        handle: Embree scene. vertices, normals: float32 (v, 3), each shape's in its own frame. faces: int32 (f, 3),
        indices into them. uv: float32 (v, 2). w: float64, obscurance, each object's in a stretch of its own.
        first_vertex, first_face, first_w: int64 (o,), where an object's stretches begin.
        to_world: float64 (o, 3, 4); normal_to_world: (o, 3, 3); mirrored: −1 where the transform mirrors, else 1.
        placed: bool (o,), whether the arrays hold world coordinates already. authored: whether the normals are the
        source's own. magnitude: least |coordinate| that ray offsets reckon with.
        texture: int64 (o,), −1 for none. kinds, rows: the objects' packed materials. boxes: around all that casts
        shadows (`raytrace.shade.shaft_culling.pack_boxes`).
    """

    handle: Any
    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    uv: npt.NDArray[np.float32]
    w: Floats
    first_vertex: npt.NDArray[np.int64]
    first_face: npt.NDArray[np.int64]
    first_w: npt.NDArray[np.int64]
    to_world: Floats
    normal_to_world: Floats
    mirrored: Floats
    placed: npt.NDArray[np.bool_]
    authored: npt.NDArray[np.bool_]
    magnitude: Floats
    texture: npt.NDArray[np.int64]
    kinds: npt.NDArray[np.int64]
    rows: Floats
    boxes: npt.NDArray[np.float32]


class Lights(NamedTuple):
    """Packed lights in the world's own units: kinds int64 (k,), rows float64 (k, …)."""

    kinds: npt.NDArray[np.int64]
    rows: Floats
