"""Records that kernels read a scene from, and the one that they write a picture to."""

from typing import Any, NamedTuple

from ..image.texture import PackedTextures
from ..mesh.opacity import PackedOpacity
from ..types import Bools, Float32s, Float64s, Int32s, Int64s


class Geometry(NamedTuple):
    """Shapes and objects in render space: o objects, v vertices and f faces of their shapes.

    Attributes:
        handle: Embree scene. farthest: longer than anything in render space.
        vertices, normals: float32 (v, 3), each shape's in its own frame. faces: int32 (f, 3), indices into them.
        uv: float32 (v, 2). occlusion_uv: float32 (v, 2), or (0, 2) if no shape has any.
        colours: float32 (v, 3), linear RGB, or (0, 3) if no shape has any.
        polygons: int32 (f,), rows of `vertices` and `normals`, behind the shapes' rows, with the centre and the
        Newell normal of each face's polygon, −1 for a face of its own; (0,) if there are no polygons. edges: int32
        (e, 2), vertices of the polygons' outlines; first_edge: int32 (p + 1,), the first edge of each polygon.
        first_vertex, first_face: int64 (o,), the first vertex and face of each object's shape. first_w: int64 (o + 1,),
        the first row of each object in w, and the number of rows.
        to_render: float64 (o, 3, 4), the frame of `vertices` to render space; normal_to_render: (o, 3, 3).
        mirrored: float64 (o,), −1 where the object's transform mirrors, else 1.
        placed: bool (o,), whether `vertices` are in render space already. authored: bool (o,), whether the normals are
        the source's own. magnitude: float64 (o,), least |coordinate| that ray offsets reckon with.
        texture, occlusion, grain: int64 (o,), −1 for none. strength: float64 (o,), of `occlusion`.
        kinds: int64 (o,), rows: float64 (o, …), packed materials (`raytrace.brdf.layout`). boxes: around all that
        casts shadows (`raytrace.shade.shaft_culling.pack_boxes`). opacity: of the shapes' faces; None if all is opaque,
        materials included.
    """

    handle: Any
    farthest: float
    vertices: Float32s
    normals: Float32s
    faces: Int32s
    uv: Float32s
    occlusion_uv: Float32s
    colours: Float32s
    polygons: Int32s
    edges: Int32s
    first_edge: Int32s
    first_vertex: Int64s
    first_face: Int64s
    first_w: Int64s
    to_render: Float64s
    normal_to_render: Float64s
    mirrored: Float64s
    placed: Bools
    authored: Bools
    magnitude: Float64s
    texture: Int64s
    occlusion: Int64s
    grain: Int64s
    strength: Float64s
    kinds: Int64s
    rows: Float64s
    boxes: Float32s
    opacity: PackedOpacity | None


class Lights(NamedTuple):
    """Packed lights in render space.

    Attributes:
        kinds: int64 (k,), rows: float64 (k, …) (`raytrace.lights.layout`). skies: float64 (s, SKY_WIDTH), gradients.
        harmonics: float64 (9, 3) of an image, or (0, 3). maps: float32 (MAPS, MAP_HEIGHT, MAP_WIDTH, 3), or none.
        frame: float64 (3, 3), rows right, front and up of the maps.
    """

    kinds: Int64s
    rows: Float64s
    skies: Float64s
    harmonics: Float64s
    maps: Float32s
    frame: Float64s


class SceneArrays(NamedTuple):
    """All that kernels read of a scene.

    Attributes:
        w: float64 (n,), obscurance at every vertex of every object. bent: float32 (n, 3), bent normals there, zero for
        none, or (0, 3) where no light asks for them. lit_vertices: float64 (n, LIGHTING), light at them
        for Gouraud shading (`raytrace.shade.shading_points.lighting_column`), and n rows more for the vertices' backs
        where backs may reflect light; (0, LIGHTING) for all shadings but Gouraud.
    """

    geometry: Geometry
    w: Float64s
    bent: Float32s
    lights: Lights
    textures: PackedTextures
    lit_vertices: Float64s


class Film(NamedTuple):
    """The pixels that tiles are rendered to.

    Attributes:
        pixels: float32 (height, width, 4 or FILM), whole tiles. left, top: place of its first pixel in the picture.
        edges: float32 (tiles, 4, TILE, EDGE), what tiles know of one another, or none where no pixel is retired early.
        scale: of render space; depths are divided by it.
    """

    pixels: Float32s
    left: int
    top: int
    edges: Float32s
    scale: float
