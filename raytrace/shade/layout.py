"""Records that kernels of shading read and write: packets of points, a scene, options, a thread's memory, the film.

A packet is a float32 array (WIDTH, 16) of sixteen points; its first `FILM` rows are the layers of
`raytrace.image.formats`. Positions are in render space. Shapes: o objects, v vertices and f faces of their shapes.
"""

from typing import Annotated, NamedTuple

import numpy as np

from ..image.texture_lookup import PackedTextures
from ..kernel.jit import inline
from ..kernel.simd import load_row, select, store_row
from ..types import (
    Bools,
    Float32Grid,
    Float32Rows,
    Float32s,
    Float64Grid,
    Float64Rows,
    Float64s,
    Int32Rows,
    Int32s,
    Int64s,
)

# Numba compiles a function anew for every constant of Python's that it is given, but only once for NumPy's.
BEAUTY, ALPHA = np.array([0, 3])  # RGB, the sum of the next four, and opacity
AMBIENT, DIFFUSE, SPECULAR, EMISSION = np.array([4, 7, 10, 13])  # RGB; the background counts as emitted
W, SHADOW = np.array([16, 17])  # obscurance w(p), and the part of the light that δ lets through
DEPTH = np.int64(18)  # distance to the viewer, infinite where nothing is hit
NORMAL = np.int64(19)  # unit shading normal on the viewer's side; zero reflects nothing
ALBEDO = np.int64(22)  # the material's colour times its texture, RGB
ID = np.int64(25)  # row of the object plus 1, 0 for none
FILM = 26
POINT = np.int64(26)  # where light is gathered (a face's centroid under constant shading)
ORIGIN, BACK = np.array([29, 32])  # of shadow rays: safely above the surface; and to lights behind it, if they matter
VIEW = np.int64(35)  # unit direction to the viewer
TANGENT = np.int64(38)  # grain: along u, or as a texture has it; zero without texture coordinates
ALBEDO_MAP = np.int64(41)  # albedo texture times colours of vertices, RGB, 1 without
FRONT = np.int64(44)  # lights seen: 0 none, ON_THIS_SIDE, ON_BOTH_SIDES of the surface
UNSHADOWED, SHADOWED = np.array([45, 46])  # luminous sum over lights without δ, and with it
OCCLUSION = np.int64(47)  # occlusion texture, 1 without
BENT = np.int64(48)  # direction of what is open, of any length; zero where none is known
DISC = np.int64(51)  # place of the sample on the unit disc of lights with an extent, x and y
WIDTH = 53
ON_THIS_SIDE, ON_BOTH_SIDES = 1.0, 2.0
LIGHTING = 14  # columns that lighting writes, see `lighting_column`
# Of `Scratch.layers`, behind the film's: of a ray its transmittance and where it goes on; of a packet where its rays
# would go on, and the alpha of what they hit.
TRANSMITTANCE, BEGIN, NEXT, COVER = np.array([26, 27, 28, 29])

OFF, _AMBIENT_ONLY, BOOK = range(3)  # forms of obscurance
PRIMARY, SHADOW_RAYS, BEHIND, UNREACHED, BLACK, CULLED, UNOBSTRUCTED, BACKGROUND, RETIRED = range(9)  # counts of rays
COUNTERS = 9


@inline
def load3(packet, column):
    """Three columns of a packet, from `column` on."""
    return load_row(packet, column), load_row(packet, column + 1), load_row(packet, column + 2)


@inline
def store3(packet, column, mask, a):
    """Write three columns in the lanes of the mask `mask`."""
    for c in range(3):
        store1(packet, column + c, mask, a[c])


@inline
def store1(packet, column, mask, a):
    """Write a column in the lanes of the mask `mask`."""
    store_row(packet, column, select(mask, a, load_row(packet, column)))


@inline
def lighting_column(number):
    """The columns that lighting writes, one after another: AMBIENT to EMISSION, UNSHADOWED and SHADOWED."""
    return AMBIENT + number if number < W - AMBIENT else UNSHADOWED + number - (W - AMBIENT)


class Geometry(NamedTuple):
    """Shapes and objects in render space."""

    handle: np.uint64  # Embree scene
    farthest: float  # longer than anything in render space
    vertices: Float32Rows  # (v, 3), each shape's in its own frame; behind them the centre of each polygon
    normals: Float32Rows  # of `vertices`; of a polygon Newell's
    faces: Int32Rows  # (f, 3), rows of `vertices`
    uv: Float32Rows  # (v, 2)
    occlusion_uv: Float32Rows  # (v, 2), or (0, 2) if no shape has any
    colours: Float32Rows  # (v, 3), linear RGB, or (0, 3) if no shape has any
    polygons: Int32s  # (f,), row of each face's polygon in `vertices`, −1 for a face of its own; (0,) without polygons
    edges: Int32Rows  # (e, 2), vertices of the polygons' outlines
    first_edge: Int32s  # (p + 1,), of each polygon
    first_vertex: Int64s  # (o,), of each object's shape
    first_face: Int64s
    first_w: Int64s  # (o + 1,), the first row of each object in w, and the number of rows
    to_render: Float64Grid  # (o, 3, 4), from the frame of `vertices`
    normal_to_render: Float64Grid  # (o, 3, 3)
    mirrored: Float64s  # (o,), −1 where the object's transform mirrors, else 1
    placed: Bools  # (o,), whether `vertices` are in render space already
    authored: Bools  # (o,), whether the normals are the source's own
    magnitude: Float64s  # (o,), least |coordinate| that ray offsets reckon with
    texture: Int64s  # (o,), −1 for none
    occlusion: Int64s
    grain: Int64s
    strength: Float64s  # (o,), of `occlusion`
    kinds: Int64s  # (o,), of materials packed as `raytrace.brdf.material` has them
    materials: Float64Rows  # (o, …), see `raytrace.brdf.material`
    boxes: Float32Grid  # around all that casts shadows, of `raytrace.shade.shaft_culling.pack_boxes`
    layered: bool  # whether light passes some of the surfaces


class Lights(NamedTuple):
    """Packed lights in render space."""

    kinds: Int64s  # (k,), of lights that come from somewhere
    parameters: Float64Rows  # (k, …), see `raytrace.lights.kernels`
    ambient: Float64s  # (3,), the sum of ambient lights
    skies: Float64Rows  # (s, SKY_WIDTH), gradients
    harmonics: Float64Rows  # (9, 3), of an image, or (0, 3)
    maps: Annotated[Float32s, 4]  # (MAPS, MAP_HEIGHT, MAP_WIDTH, 3), or none
    frame: Float64Rows  # (3, 3), rows right, front and up of the maps


class SceneArrays(NamedTuple):
    """All that kernels read of a scene."""

    geometry: Geometry
    w: Float64s  # (n,), obscurance at every vertex of every object
    bent: Float32Rows  # (n, 3), bent normals there, zero for none; (0, 3) where no light asks for them
    lights: Lights
    textures: PackedTextures
    lit_vertices: Float64Rows  # of Gouraud shading, (n, LIGHTING), n more for backs that may reflect light; else none


class Style(NamedTuple):
    """Options of a picture."""

    samples: int  # most a pixel
    shading: int  # of `raytrace.settings.Shading`
    form: int  # of obscurance
    shadows: bool
    terminator: bool
    layers: bool  # whether all of them are wanted, not beauty alone
    weighted: bool  # whether w is wanted
    background: tuple[float, float, float]  # linear RGB


class Scratch(NamedTuple):
    """Memory that one thread works with."""

    rays: Float32Rows  # sixteen rays, of `raytrace.embree.new_packet`
    valid: Int32s
    points: Float32Grid  # (packets, WIDTH, 16), points to be lit
    items: Int32Rows  # (packets, 16), rows of their objects, −1 for none
    sums: Float64Rows  # (pixels, …), a tile's film
    cells: Float32Rows  # (cells, RANGE), a tile's, ranges of the samples in them
    retired: Bools  # (pixels,), a tile's pixels that get no more samples
    order: Int32s  # (pixels,), a tile's pixels so that sixteen on end are neighbours
    todo: Int32s  # (pixels + 16,), pixels that want more samples
    active: Int64s  # (lights,), lights that can matter
    hidden: Bools  # (lights,), whether something may stand between an active light and the points
    layers: (
        Float32Grid  # (packets, COVER + 1, 16), what viewing rays, by their numbers, have seen; none if all is opaque
    )
    active_rays: Int32Rows  # (packets, 16), numbers of the rays that are traced, −1 for none: few see further layers
    missing: Int64s  # (textures,), 1 for textures that a ray has met before they were read
    counts: Int64s  # (COUNTERS,)


class Film(NamedTuple):
    """The pixels that tiles are rendered to."""

    pixels: Float32Grid  # (height, width, 4 or FILM), whole tiles
    left: int  # place of its first pixel in the picture
    top: int
    edges: Float32Rows  # (tiles, EDGES), what tiles know of one another; none where no pixel is retired early
    scale: float  # of render space; depths are divided by it
