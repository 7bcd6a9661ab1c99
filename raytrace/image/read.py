"""Reading pictures: every format OpenImageIO knows, as linear float32."""

import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError, is_utf8
from ..settings import MAX_SIZE
from ..system.atomic import PathName
from ..system.checks import check_memory, check_regular
from ..types import Float32s
from .colour import decoding_table, stored_type
from .formats import NAMESPACE, openimageio

GROWTH, SPARE = 1100, 1 << 26  # deflate grows 1032-fold at most; 64 MiB hold 4096×4096 pixels of four bytes
_JPEG_2000 = b"\0\0\0\x0cjP  \r\n\x87\n", b"\xff\x4f\xff\x51"
_UNREAD = {b"\xabKTX 20": "KTX2", b"ftypavif": "AVIF"}  # what first bytes hold, of formats that are known by name alone
_LIMIT, _TOO_LARGE = "limits:imagesize_MB", " exceeds the"  # of OpenImageIO
_ROWS = 64
_FEW = 1 << 20  # bytes; to look at what is available takes longer than to decode so few
_printing = threading.Lock()
_ORDER = {name: position for position, name in enumerate("RGBXYZA")}


def read_image(path: PathName) -> tuple[dict[str, Float32s], dict[str, str]]:
    """Read a picture: its layers, and the metadata that `Frame.save` stored.

    Values of 8- and 16-bit files are taken as sRGB unless the file says that they are linear; straight alpha becomes
    premultiplied. Of a file with several parts the first is read.

    Returns:
        layers: float32 (h, w, channels), linear, row 0 at the top, by name; channels that belong to no layer, which
            are all of a PNG or JPEG, are "beauty": grey, grey and alpha, RGB or RGBA, premultiplied.
        metadata: as given to `Frame.save`; empty for files from elsewhere.

    Raises:
        InputError: `path` is missing, a folder, not an image, damaged, or more than 32768 pixels wide or high.
        MemoryLimitError: its pixels do not fit into memory.
    """
    image = open_image(path)
    spec = image.spec()
    check_pixels(image, path, 4 * spec.nchannels)
    groups = _layers(list(spec.channelnames))
    layers = {name: np.empty((spec.height, spec.width, len(group)), np.float32) for name, group in groups.items()}
    values = decoding_table(spec)
    for block_rows, block in row_blocks(image, path):
        for name, group in groups.items():
            linear = block[..., group] if values is None else values[block[..., group]]
            if values is not None and spec.alpha_channel in group:
                linear[..., -1] = block[..., group[-1]] / np.float32(len(values) - 1)
                linear[..., :-1] *= linear[..., -1:]
            layers[name][block_rows] = linear
    return layers, _metadata(spec)


def read_metadata(path: PathName) -> dict[str, str]:
    """The metadata that `read_image` returns, without the pixels. Raises: InputError: as `open_image`."""
    return _metadata(open_image(path).spec())


def open_image(path: PathName, content: Path | None = None, max_side: int = MAX_SIZE) -> Any:
    """An `OpenImageIO.ImageInput`, alpha left as it is in the file.

    Args: path: the file, and its name in messages. content: the file to open in its place. max_side: most pixels.

    Raises:
        InputError: `path` is missing, a folder, not an image, too large, or claims more pixels than its bytes can hold.
    """
    oiio = openimageio()

    # A file that can be read and opened.
    name = os.fspath(path)
    file = Path(path) if content is None else content
    try:
        check_regular(file, "an image file", source=name)
        with file.open("rb") as begun:
            head = begun.read(16)
    except OSError as reason:
        raise InputError(name, "file", "a readable file", reason.strerror or reason) from None
    if not is_utf8(str(file)):
        raise InputError(name, "file", "a path in UTF-8", "other bytes")
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    stored = file.stat().st_size
    with _silenced(), _limited(oiio, file, stored):
        image = oiio.ImageInput.open(str(file), config)
    if image is None:
        message = _reason(oiio, file)
        if _TOO_LARGE in message:
            raise InputError(name, "size", f"pixels that {stored:,} bytes can hold", message.partition(_TOO_LARGE)[0])
        unread = (f"{called}, which is not read" for begins, called in _UNREAD.items() if begins in head)
        raise InputError(name, "content", "an image", next(unread, message))
    # Pixels that its bytes can hold, few enough, and flat.
    spec = image.spec()
    size = f"{spec.width}×{spec.height}"
    if max(spec.width, spec.height) > max_side:
        raise InputError(name, "size", f"at most {max_side}×{max_side} pixels", size)
    if min(spec.width, spec.height, spec.nchannels) < 1:
        raise InputError(name, "size", "one pixel or more", size)
    if max(spec.image_bytes(True), spec.tile_bytes(True)) > GROWTH * stored + SPARE:
        raise InputError(name, "size", f"pixels that {stored:,} bytes can hold", f"{size} of {spec.nchannels} channels")
    if spec.deep or spec.depth > 1:
        raise InputError(name, "content", "a flat image", "a deep or volume image")
    return image


def check_pixels(image: Any, path: PathName, pixel_bytes: int) -> None:
    """Refuse to decode an opened image whose pixels of `pixel_bytes` bytes do not fit. Raises: MemoryLimitError."""
    spec = image.spec()
    needed = pixel_bytes * spec.width * spec.height
    if needed > _FEW:
        check_memory(os.fspath(path), needed, f"to read {spec.width:,}×{spec.height:,} pixels")


def row_blocks(image: Any, path: PathName) -> Iterator[tuple[slice, npt.NDArray[Any]]]:
    """Read an opened image from the top: pairs of a slice of rows and their uint8 or uint16 codes, or float32.

    Raises: InputError.
    """
    spec = image.spec()
    kind = stored_type(spec).replace("float32", "float")  # as OpenImageIO calls it
    step = spec.tile_height or _ROWS
    for top in range(0, spec.height, step):
        end = min(top + step, spec.height)
        scanlines = (spec.y + top, spec.y + end)
        channels = (0, spec.nchannels)
        with _silenced():
            if spec.tile_width:
                numbers = image.read_tiles(0, 0, spec.x, spec.x + spec.width, *scanlines, 0, 1, *channels, kind)
            else:
                numbers = image.read_scanlines(0, 0, *scanlines, 0, *channels, kind)
        reason = _reason(image, Path(path))
        if numbers is None or "premature end" in reason.lower():  # other messages about JPEG data are warnings
            raise InputError(os.fspath(path), "content", "a complete image", reason)
        yield slice(top, end), np.asarray(numbers).reshape(end - top, spec.width, spec.nchannels)


@contextmanager
def _silenced() -> Iterator[None]:
    """Hold back what libpng prints on the standard error by itself; OpenImageIO's message says the same."""
    with _printing, open(os.devnull, "wb") as nowhere:
        try:
            saved_stderr = os.dup(2)
        except OSError:  # there is none
            yield
            return
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(saved_stderr, 2)
            os.close(saved_stderr)


@contextmanager
def _limited(oiio: Any, file: Path, stored: int) -> Iterator[None]:
    """Have OpenImageIO refuse a JPEG2000 by its header, all of which it decodes to open it, in 14 times the memory."""
    with file.open("rb") as opened:
        if not opened.read(12).startswith(_JPEG_2000):
            yield
            return
    usual = oiio.get_int_attribute(_LIMIT)
    oiio.attribute(_LIMIT, (GROWTH * stored + SPARE // 8 >> 20) + 1)
    try:
        yield
    finally:
        oiio.attribute(_LIMIT, usual)


def _layers(names: list[str]) -> dict[str, list[int]]:
    """Channel numbers of each layer: R G B, X Y Z, then A."""
    layers: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        layers.setdefault(name.rpartition(".")[0] or "beauty", []).append(number)
    for group in layers.values():
        group.sort(key=lambda number: _ORDER.get(names[number].rpartition(".")[2].upper(), len(_ORDER)))
    return layers


def _metadata(spec: Any) -> dict[str, str]:
    """What `Frame.save` stored: attributes of our name space, or JSON in the image's description."""
    by_name = {attribute.name: attribute.value for attribute in spec.extra_attribs}
    metadata = {name.removeprefix(NAMESPACE): str(text) for name, text in by_name.items() if name.startswith(NAMESPACE)}
    if metadata:
        return metadata
    with suppress(TypeError, ValueError, RecursionError, AttributeError):  # not JSON, or no object
        metadata = {name: str(text) for name, text in json.loads(by_name.get("ImageDescription", "")).items()}
    return metadata


def _reason(reader: Any, file: Path) -> str:
    """The message of OpenImageIO, or of an image, without the file's name, which stands before it already."""
    reason = ""
    with suppress(UnicodeDecodeError):  # it quotes the damaged bytes
        reason = reader.geterror()
    lines = [line.replace(f' ("{file}")', "").replace(str(file), file.name) for line in reason.splitlines()]
    return " ".join(dict.fromkeys(line.strip() for line in lines if line.strip())) or "damaged or cut off"
