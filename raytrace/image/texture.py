"""Albedo textures: image files, read into pyramids of images (Williams 1983) once a ray has met them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from ..errors import InputError, OptionError
from ..types import Float32s, Int64s, UInt8s, UInt16s
from .read import decoding_table, open_image, row_blocks

MAX_SIDE = 16384
_TEXEL = 16  # bytes of a texel with its share of the coarser levels
_WORKING = 12  # bytes of a texel while the coarser levels are made
Wrap = Literal["repeat", "mirrored_repeat", "clamp_to_edge"]
WRAPS: tuple[Wrap, ...] = get_args(Wrap)
"""glTF's wrap modes; kernels know them by their places here."""


@dataclass(frozen=True)
class Texture:
    """An image file, or the bytes of one (a GLB keeps its images inside). Pickled, it takes the file's bytes along.

    Attributes:
        path: the file, or what to call the image in messages when `data` is given.
        data: the file's content, or None to read `path`.
        srgb: whether its values are sRGB-encoded, as colour textures are. Files of floats are always linear.
        wrap: what lies beyond [0, 1] along u and along v, as glTF has it: "repeat", "mirrored_repeat" (every other
            copy is reversed) or "clamp_to_edge" (the texels of the edge go on). One name means both.

    Raises:
        OptionError: another mode.
    """

    path: Path
    data: bytes | None = None
    srgb: bool = True
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")

    def __post_init__(self) -> None:
        object.__setattr__(self, "wrap", wrap_modes(self.wrap))

    def __reduce__(self) -> tuple[type[Texture], tuple[object, ...]]:
        data = self.data
        with suppress(OSError):  # who reads a file that is missing here will say so
            data = self.path.read_bytes() if data is None else data
        return Texture, (self.path, data, self.srgb, self.wrap)


def wrap_modes(given: Any) -> tuple[Wrap, Wrap]:
    """The modes along u and v of one name, or of two. Raises: OptionError."""
    modes = (given, given) if isinstance(given, str) else tuple(given) if isinstance(given, list | tuple) else ()
    if len(modes) != 2 or not all(isinstance(mode, str) and mode in WRAPS for mode in modes):
        raise OptionError("wrap", "one or two of " + ", ".join(WRAPS), given, "texture")
    return modes


class PackedTextures(NamedTuple):
    """Textures as kernels read them (`raytrace.image.texture_lookup`): each a pyramid of halved images down
    to one texel.

    Takes 16 bytes for each texel of the files: three floats, and a third more for the coarser levels.

    Attributes:
        texels: float32 (n, 3), linear RGB; levels one after the other, rows from the top.
        levels: int64 (m, 3): first texel, width, height of each level; finest first.
        first: int64 (t,): each texture's finest level.
        depth: int64 (t,): each texture's number of levels, 0 if it was left out.
        wrap: int64 (t, 2): its modes along u and v, places in `WRAPS`.
    """

    texels: Float32s
    levels: Int64s
    first: Int64s
    depth: Int64s
    wrap: Int64s


def pack_textures(textures: Sequence[Texture | None]) -> PackedTextures:
    """Read textures; those of one image once, however they are wrapped.

    Alpha is ignored; grey becomes RGB. Files may have 8 or 16 bits, floats, a palette, one to four channels.

    Args:
        textures: None leaves a texture out and keeps the numbers of the others: only those that rays have seen need
            be read.

    Raises:
        InputError: a file is missing, damaged, not an image, or more than 16384 texels wide or high.
    """
    places: dict[Texture | None, tuple[int, int]] = {None: (0, 0)}
    levels: list[tuple[int, int, int]] = []
    end = 0
    images = [_image(texture) for texture in textures]
    for texture in images:
        if texture is None or texture in places:
            continue
        with _opened(texture) as image:
            sizes = _sizes(image.spec().width, image.spec().height)
        places[texture] = len(levels), len(sizes)
        for width, height in sizes:
            levels.append((end, width, height))
            end += width * height
    texels = np.empty((end, 3), np.float32)
    for texture, (first, count) in places.items():
        if texture is not None:
            with _opened(texture) as image:
                _build_pyramid(
                    [texels[at : at + w * h].reshape(h, w, 3) for at, w, h in levels[first : first + count]],
                    image,
                    texture,
                )
    entries = np.array([places[texture] for texture in images], np.int64).reshape(-1, 2)
    all_levels = np.array(levels, np.int64).reshape(-1, 3)
    modes = [(0, 0) if texture is None else [WRAPS.index(mode) for mode in texture.wrap] for texture in textures]
    wrap = np.array(modes, np.int64).reshape(-1, 2)
    return PackedTextures(texels, all_levels, entries[:, 0].copy(), entries[:, 1].copy(), wrap)


def _image(texture: Texture | None) -> Texture | None:
    """What two textures of one image have in common."""
    return texture and replace(texture, wrap=("repeat", "repeat"))


def texture_bytes(textures: Iterable[Texture | None]) -> int:
    """Bytes that `pack_textures` takes at its peak, called as rays meet one after the other; by headers.

    A file that cannot be read counts nothing: perhaps no ray meets it.
    """
    texels = [0]
    for texture in dict.fromkeys(_image(texture) for texture in textures):
        if texture is not None:
            with suppress(InputError), _opened(texture) as image:
                texels.append(image.spec().width * image.spec().height)
    before = sum(texels) - min(texels[1:], default=0)  # what was packed the time before is let go of afterwards
    return _TEXEL * (sum(texels) + before) + _WORKING * max(texels)


def texture_codes(texture: Texture) -> UInt8s | UInt16s | Float32s:
    """The numbers of an image as stored, (h, w, 1 to 4), rows from the top, alpha straight.

    Raises: InputError: as `pack_textures`.
    """
    with _opened(texture) as image:
        return np.concatenate([codes for _, codes in row_blocks(image, texture.path)])


@contextmanager
def _opened(texture: Texture) -> Iterator[Any]:
    with tempfile.TemporaryDirectory() if texture.data is not None else nullcontext() as folder:
        content = None
        if folder is not None and texture.data is not None:
            content = Path(folder) / f"texture{texture.path.suffix}"
            content.write_bytes(texture.data)
        image = open_image(texture.path, content, MAX_SIDE)
        try:
            yield image
        finally:
            image.close()


def _sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Width and height of a pyramid's levels: halves, rounded down, until one texel is left."""
    sizes = [(width, height)]
    while max(width, height) > 1:
        width, height = max(width // 2, 1), max(height // 2, 1)
        sizes.append((width, height))
    return sizes


def _build_pyramid(pyramid: list[Float32s], image: Any, texture: Texture) -> None:
    """Read the finest level and reduce it to the others."""
    import OpenImageIO as oiio

    _read(pyramid[0], image, texture)
    height, width = pyramid[0].shape[:2]
    level = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, "float"))
    level.set_pixels(oiio.ROI(), pyramid[0])
    for coarser in pyramid[1:]:
        height, width = coarser.shape[:2]
        level = oiio.ImageBufAlgo.resize(level, "box", roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
        coarser[:] = level.get_pixels(oiio.FLOAT)


def _read(linear: Float32s, image: Any, texture: Texture) -> None:
    spec = image.spec()
    values = decoding_table(spec, texture.srgb)
    channels = 3 if spec.nchannels >= 3 else 1
    for rows, numbers in row_blocks(image, texture.path):
        colour = numbers[..., :channels]
        linear[rows] = colour if values is None else values[colour]
