"""Records that kernels read a scene from, and the one that they write a picture to."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..image.texture import PackedTextures

Floats = npt.NDArray[np.float64]


class Geometry(NamedTuple):
    """Shapes and objects in render space: o objects, v vertices and f faces of their shapes.

    Attributes:
        handle: Embree scene. vertices, normals: float32 (v, 3), each shape's in its own frame. faces: int32 (f, 3),
        indices into them. uv: float32 (v, 2).
        first_vertex, first_face: int64 (o,), where the shape of each object begins. first_w: int64 (o + 1,), where
        each object's vertices begin, and the last one's end, among those of all objects, as in w.
        to_render: float64 (o, 3, 4), the frame of `vertices` to render space; normal_to_render: (o, 3, 3).
        mirrored: float64 (o,), −1 where the object's transform mirrors, else 1.
        placed: bool (o,), whether `vertices` are in render space already. authored: bool (o,), whether the normals are
        the source's own. magnitude: float64 (o,), least |coordinate| that ray offsets reckon with.
        texture: int64 (o,), −1 for none. kinds: int64 (o,), rows: float64 (o, …), packed materials
        (`raytrace.brdf.layout`). boxes: around all that casts shadows (`raytrace.shade.shaft_culling.pack_boxes`).
    """

    handle: Any
    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    uv: npt.NDArray[np.float32]
    first_vertex: npt.NDArray[np.int64]
    first_face: npt.NDArray[np.int64]
    first_w: npt.NDArray[np.int64]
    to_render: Floats
    normal_to_render: Floats
    mirrored: Floats
    placed: npt.NDArray[np.bool_]
    authored: npt.NDArray[np.bool_]
    magnitude: Floats
    texture: npt.NDArray[np.int64]
    kinds: npt.NDArray[np.int64]
    rows: Floats
    boxes: npt.NDArray[np.float32]


class Lights(NamedTuple):
    """Packed lights in render space: kinds int64 (k,), rows float64 (k, …) (`raytrace.lights.layout`)."""

    kinds: npt.NDArray[np.int64]
    rows: Floats


class SceneArrays(NamedTuple):
    """All that kernels read of a scene.

    Attributes:
        w: float64 (n,), obscurance at every vertex of every object. lit_vertices: float64 (n, LIGHTING), light at them
        for Gouraud shading (`raytrace.shade.shading_points.lighting_column`); (0, LIGHTING) for other shadings.
    """

    geometry: Geometry
    w: Floats
    lights: Lights
    textures: PackedTextures
    lit_vertices: Floats


class Film(NamedTuple):
    """What tiles are rendered to.

    Attributes:
        pixels: float32 (height, width, 4 or FILM), whole tiles. left, top: place of its first pixel in the picture.
        edges: float32 (tiles, 4, TILE, EDGE), what tiles know of one another, or none where no pixel is retired early.
        scale: of render space; depths are divided by it.
    """

    pixels: npt.NDArray[np.float32]
    left: int
    top: int
    edges: npt.NDArray[np.float32]
    scale: float
