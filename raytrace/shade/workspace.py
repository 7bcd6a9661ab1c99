"""Options of a picture for its kernels, and the memory that one thread works with."""

from typing import NamedTuple

import numpy as np

from ..embree.packets import new_packet
from ..kernel.arrays import aligned
from ..kernel.simd import WIDE
from ..types import Bools, Float32s, Float64s, Int32s, Int64s
from .film import SUMS, TILE
from .shading_points import COVER, WIDTH

FIRST = 4  # samples before a pixel may be retired
PACKETS = TILE * TILE * FIRST // WIDE  # lit together
OFF, AMBIENT_ONLY, BOOK = range(3)
PRIMARY, SHADOW_RAYS, BACKGROUND, BEHIND, UNREACHED, BLACK, CULLED, UNOBSTRUCTED, RETIRED = range(9)
COUNTERS = 9


class Style(NamedTuple):
    """Options of a picture.

    Attributes:
        samples: most a pixel. shading, form: numbers of the interpolation and of the obscurance form. shadows,
        terminator: whether. layers: whether all of them are wanted, not beauty alone; weighted: whether w is.
        background: linear RGB.
    """

    samples: int
    shading: int
    form: int
    shadows: bool
    terminator: bool
    layers: bool
    weighted: bool
    background: tuple[float, float, float]


class Scratch(NamedTuple):
    """Memory that one thread works with.

    Attributes:
        rays, valid: sixteen rays (`raytrace.embree.packets.new_packet`).
        points: float32 (packets, WIDTH, 16), points to be lit; items: int32 (packets, 16), rows of their objects, −1
        for none. sums: float64 (pixels, …), a tile's film. order: int32 (pixels,), a tile's pixels so that sixteen on
        end are neighbours; todo: int32 (pixels + 16,), pixels that want more samples. active: int64 (lights,), lights
        that can matter; hidden: bool (lights,), whether something may stand between an active light and the points.
        layers: float32 (packets or 0, FILM + 4, 16), of each viewing ray, by its number: what it has seen in front, and
        in the columns THROUGH and BEGIN its transmittance and where it goes on; of each packet BEHIND and COVER: where
        its rays would go on, and the alpha of what they hit. None where all is opaque. going: int32 (packets, 16),
        numbers of the rays that are traced, −1 for none: rays that see further layers fill few packets.
        missing: int64 (textures,), 1 for textures that a ray has met before they were read. counts: int64 (COUNTERS,).
    """

    rays: Float32s
    valid: Int32s
    points: Float32s
    items: Int32s
    sums: Float64s
    order: Int32s
    todo: Int32s
    active: Int64s
    hidden: Bools
    layers: Float32s
    going: Int32s
    missing: Int64s
    counts: Int64s


def new_scratch(lights: int, textures: int, hit_filter: tuple[int, Int64s] | None = None) -> Scratch:
    """Scratch for a scene with so many lights and textures. Args: hit_filter: None where all is opaque."""
    pixels = np.arange(TILE * TILE, dtype=np.int32)  # row · TILE + column; blocks of 4×4 make a packet
    return Scratch(
        *new_packet(WIDE, True, hit_filter),
        points=aligned((PACKETS, WIDTH, WIDE), np.float32),
        items=aligned((PACKETS, WIDE), np.int32),
        sums=aligned((TILE * TILE, SUMS), np.float64),
        order=pixels.reshape(TILE // 4, 4, TILE // 4, 4).transpose(0, 2, 1, 3).ravel(),
        todo=aligned((TILE * TILE + WIDE,), np.int32),
        active=np.zeros(max(lights, 1), np.int64),
        hidden=np.zeros(max(lights, 1), np.bool_),
        layers=aligned((PACKETS if hit_filter else 0, COVER + 1, WIDE), np.float32),
        going=aligned((PACKETS, WIDE), np.int32),
        missing=np.zeros(textures, np.int64),
        counts=np.zeros(COUNTERS, np.int64),
    )
