"""Albedo textures: image files, read into pyramids of images (Williams 1983) once a ray has met them."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args

import numpy as np

from ..errors import InputError, OptionError
from ..system.checks import check_memory
from ..types import Float32s, Float64s, UInt8s, UInt16s
from .colour import decoding_table, stored_type
from .formats import openimageio
from .read import check_pixels, open_image, row_blocks
from .texture_lookup import PackedTextures

MAX_SIDE = 16384
_TEXEL = 16  # bytes of a texel with its share of the coarser levels
_WORKING = 12  # bytes of a texel while the coarser levels are made
_ALPHA = 8  # bytes of a texel while its alpha is made from what is stored
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # ITU-R BT.709
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


class LazyTextures:
    """Textures with a place for each, by their files' headers; read when they are asked for, each image once.

    Alpha is ignored; grey becomes RGB. A place takes no memory before its texture is read. `packed`: what kernels read,
    also while others are read.
    """

    def __init__(self, textures: Sequence[Texture]) -> None:
        self._images = [replace(texture, wrap=("repeat", "repeat")) for texture in textures]
        self._locks = {image: threading.Lock() for image in self._images}
        self._sizes = {image: _levels(image) for image in self._locks}
        levels = np.array([size for sizes in self._sizes.values() for size in sizes], np.int64).reshape(-1, 2)
        end = np.cumsum(levels.prod(axis=1))
        counts = np.cumsum([0] + [len(sizes) for sizes in self._sizes.values()])
        image_level = dict(zip(self._sizes, counts.tolist(), strict=False))
        self.packed = PackedTextures(
            texels=np.empty((int(end[-1]) if len(end) else 0, 3), np.float32),
            levels=np.column_stack([end - levels.prod(axis=1), levels]),
            first_level=np.array([image_level[image] for image in self._images], np.int64),
            depth=np.zeros(len(textures), np.int64),
            wrap=np.array([[WRAPS.index(mode) for mode in t.wrap] for t in textures], np.int64).reshape(-1, 2),
        )

    def read(self, numbers: Iterable[int]) -> None:
        """Read the textures `numbers` that are not read yet; images that another thread reads come last."""
        images = dict.fromkeys(self._images[number] for number in numbers)
        for waits, image in product((False, True), images):
            if self._locks[image].acquire(blocking=waits):
                try:
                    self._read(image)
                finally:
                    self._locks[image].release()

    def _read(self, image: Texture) -> None:
        """Read an image into every place that it has in `packed`. Raises: InputError: it has changed since."""
        numbers = [number for number, read in enumerate(self._images) if read == image]
        texels, sizes = self.packed.texels, self._sizes[image]
        if self.packed.depth[numbers[0]]:
            return
        with _opened(image) as file:
            if not sizes or sizes[0] != (file.spec().width, file.spec().height):
                raise InputError(str(image.path), "file", "one that stays as it is while it is used", "another")
            levels = self.packed.levels[self.packed.first_level[numbers[0]] :][: len(sizes)]
            _build_pyramid([texels[at : at + w * h].reshape(h, w, 3) for at, w, h in levels], file, image)
        self.packed.depth[numbers] = len(sizes)  # last: from now on kernels look it up


def pack_textures(textures: Sequence[Texture]) -> PackedTextures:
    """Read textures, each image once, however it is wrapped. Raises: InputError; MemoryLimitError."""
    if textures:
        texels = sum(texel_counts(textures))
        check_memory(textures[0].path, texture_bytes(textures, 1), f"to read {texels:,} texels")
    lazy = LazyTextures(textures)
    lazy.read(range(len(textures)))
    return lazy.packed


def _levels(image: Texture) -> list[tuple[int, int]]:
    """Width and height of a pyramid's levels, halved to one texel; none of a file that cannot be read, if a ray asks
    for it."""
    try:
        with _opened(image) as file:
            width = file.spec().width
            height = file.spec().height
    except InputError:
        return []
    return [(max(width >> level, 1), max(height >> level, 1)) for level in range(max(width, height).bit_length())]


def texture_bytes(textures: Iterable[Texture], threads: int) -> int:
    """Bytes that `LazyTextures` take at their peak, read by so many threads, by the headers of the images."""
    texels = sorted(texel_counts(textures))
    return _TEXEL * sum(texels) + _WORKING * sum(texels[-threads:])


def texel_counts(textures: Iterable[Texture]) -> list[int]:
    """Texels of each image once, by the files' headers; images that cannot be read are left out."""
    images = dict.fromkeys(replace(texture, wrap=("repeat", "repeat")) for texture in textures)
    return [width * height for image in images for width, height in _levels(image)[:1]]


def texture_codes(texture: Texture, besides: int = 0) -> UInt8s | UInt16s | Float32s:
    """The codes of an image as stored, (h, w, 1 to 4), rows from the top, alpha straight.

    Args: besides: bytes a pixel that the caller needs.

    Raises: InputError.
    """
    with _opened(texture) as image:
        spec = image.spec()
        kind = np.dtype(stored_type(spec))
        check_pixels(image, texture.path, kind.itemsize * spec.nchannels + besides)
        codes = np.empty((spec.height, spec.width, spec.nchannels), kind)
        for at, block in row_blocks(image, texture.path):
            codes[at] = block
        return codes


def texture_alpha(texture: Texture, grey: bool = False) -> Float32s:
    """Opacity (h, w) in [0, 1] that an image has in its alpha channel, rows from the top; 1 without such a channel.

    Args: grey: an image without such a channel, or with the same number all over it, has it as luminance instead.
    """
    codes = texture_codes(texture, _ALPHA)
    most = 1.0 if codes.dtype == np.float32 else 2.0 ** (8 * codes.itemsize) - 1
    colours = codes.shape[2] - 1 + codes.shape[2] % 2  # 1 or 3
    stored = codes[..., -1] if colours < codes.shape[2] else np.full(codes.shape[:2], most, np.float32)
    if grey and (stored == stored[0, 0]).all():
        stored = codes[..., :3] @ _LUMINANCE if colours == 3 else codes[..., 0]
    alpha: Float32s = np.divide(stored, most, dtype=np.float32)
    return np.clip(np.nan_to_num(alpha, copy=False), 0.0, 1.0, out=alpha)


def texture_mean(texture: Texture) -> Float64s:
    """The mean linear RGB and the mean alpha of an image, (4,). Raises: InputError: as `LazyTextures.read`."""
    total, count = np.zeros(4), 0
    with _opened(texture) as image:
        spec = image.spec()
        table, alpha = decoding_table(spec, texture.srgb), spec.alpha_channel
        for _, codes in row_blocks(image, texture.path):
            colour = codes[..., :3] if spec.nchannels >= 3 else codes[..., [0, 0, 0]]
            total[:3] += (colour if table is None else table[colour]).sum(axis=(0, 1), dtype=np.float64)
            most = 1.0 if table is None else len(table) - 1.0
            count += len(codes) * codes.shape[1]
            total[3] += codes[..., alpha].sum(dtype=np.float64) / most if alpha >= 0 else len(codes) * codes.shape[1]
    mean: Float64s = np.clip(np.nan_to_num(total / count), 0.0, None)
    return mean


@contextmanager
def _opened(texture: Texture) -> Iterator[Any]:
    """The image as an open `ImageInput`; data of a texture go through a file, which OpenImageIO wants."""
    with ExitStack() as stack:
        content = None
        if texture.data is not None:
            content = Path(stack.enter_context(TemporaryDirectory())) / f"texture{texture.path.suffix}"
            content.write_bytes(texture.data)
        image = open_image(texture.path, content, MAX_SIDE)
        stack.callback(image.close)
        yield image


def _build_pyramid(pyramid: list[Float32s], image: Any, texture: Texture) -> None:
    """Read the finest level and reduce it to the coarser ones."""
    oiio = openimageio()

    spec = image.spec()
    values = decoding_table(spec, texture.srgb)
    for at, numbers in row_blocks(image, texture.path):
        colour = numbers[..., : 3 if spec.nchannels >= 3 else 1]
        pyramid[0][at] = colour if values is None else values[colour]
    level = oiio.ImageBuf(pyramid[0])
    for coarser in pyramid[1:]:
        height, width = coarser.shape[:2]
        level = oiio.ImageBufAlgo.resize(level, "box", roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
        coarser[:] = level.get_pixels(oiio.FLOAT)
