"""Pictures on disk: a frame's layers, or plain pixels, in the format that the name's ending asks for.

EXR holds all layers, linear. PNG (8 bits, dithered), TIFF (16) and JPEG (8, quality 95) hold one layer of colours or
fractions, sRGB-encoded. Every file appears whole or not at all, with metadata, checked to be complete on disk, and the
same picture gives the same bytes: no time stamps.
"""

import errno
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import OptionError, OutputError, printable
from ..system.atomic import PathName, atomic_path
from ..types import Float32s
from .colour import dithered, encode_srgb
from .formats import BY_COUNT, CHANNELS, DATA, LAYERS, NAMESPACE, check_image_writable, file_format, openimageio

_ALWAYS_FLOAT = ("depth", "object_id")
_LARGEST_HALF = np.float32(65504.0)
_ENDS = {"png": b"IEND\xaeB`\x82", "jpeg": b"\xff\xd9"}
_DIFFERENCES_UPWARDS = 0x20  # PNG_FILTER_UP of libpng
_ROWS = 64
_SPARE = 1 << 20


def check_image_target(
    path: PathName, half: bool = False, layers: Sequence[str] | None = None
) -> tuple[str, ...] | None:
    """Find out before the work whether `Frame.save` will be able to start.

    Returns the names of the layers that the file will hold, None for all there are. Raises: OptionError, OutputError.
    """
    format_name = file_format(path)
    if half and format_name != "openexr":
        raise OptionError("half", "an output that ends in .exr", os.fspath(path))
    for name in layers or ():
        if name not in LAYERS:
            raise OptionError("layers", "names out of " + ", ".join(LAYERS), name)
    if layers is not None and len(set(layers)) != max(len(layers), 1):
        raise OptionError("layers", "at least one layer, each once", ", ".join(layers) or "none")
    if format_name != "openexr":
        layers = ("beauty",) if layers is None else layers
        if len(layers) > 1 or layers[0] in DATA:
            got = ", ".join(layers)
            raise OptionError("layers", f"one layer of colours in a {Path(path).suffix} file, or an .exr file", got)
    check_image_writable(path)
    return None if layers is None else tuple(layers)


def write_image(path: PathName, pixels: npt.ArrayLike) -> None:
    """Write linear `pixels`, row 0 at the top, as an sRGB PNG, TIFF or JPEG. Raises: OptionError, OutputError.

    Args: pixels: (h, w) or (h, w, 1) grey, (h, w, 3) RGB, (h, w, 4) premultiplied RGBA.
    """
    check_image_target(path, layers=("beauty",))
    values = np.asarray(pixels, np.float32)
    write_picture(path, values.reshape(*values.shape[:2], -1), {})


def write_layers(path: PathName, layers: Mapping[str, Float32s], metadata: Mapping[str, str], half: bool) -> None:
    """Write an EXR file of `layers`, each (height, width, channels); colours and normals as 16-bit floats if `half`."""
    oiio = openimageio()

    height, width = next(iter(layers.values())).shape[:2]
    names: list[str] = []
    formats: list[str] = []
    for name, layer in layers.items():
        suffixes = CHANNELS.get(name, BY_COUNT[layer.shape[2]])
        names += suffixes if name == "beauty" else [f"{name}.{suffix}" for suffix in suffixes]
        formats += ["half" if half and name not in _ALWAYS_FLOAT else "float"] * layer.shape[2]
    spec = oiio.ImageSpec(width, height, len(names), "float")
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(oiio.TypeDesc(name_of_format) for name_of_format in formats)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")

    def rows(begin: int, end: int) -> Float32s:
        """Rows of all layers side by side, clipped to what their channels hold."""
        largest = {name: _LARGEST_HALF if half and name not in _ALWAYS_FLOAT else np.inf for name in layers}
        return np.concatenate([layers[name][begin:end].clip(-most, most) for name, most in largest.items()], axis=2)

    _write(path, spec, metadata, rows)


def write_picture(
    path: PathName,
    pixels: Float32s,
    metadata: Mapping[str, str],
    opaque: bool = False,
    corner: tuple[int, int] = (0, 0),
) -> None:
    """Write linear `pixels`, (height, width, channels), sRGB-encoded, without their alpha if `opaque`; PNG dithered.

    Args: corner: column and row of the first pixel in the whole picture that this is a part of.
    """
    oiio = openimageio()

    has_alpha = pixels.shape[2] == 4
    # colour where alpha is 0, which straight alpha cannot hold
    has_background = has_alpha and (pixels[..., :3].any(axis=2) & (pixels[..., 3] == 0)).any()
    straight = has_alpha and not (opaque or file_format(path) == "jpeg" or has_background)
    if has_alpha and not straight:
        pixels = pixels[..., :3]
    left, top = corner
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, "uint16" if file_format(path) == "tiff" else "uint8")
    spec.attribute("oiio:ColorSpace", "srgb_rec709_scene")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if file_format(path) == "jpeg":
        spec.attribute("Compression", "jpeg:95")
        spec.attribute("jpeg:subsampling", "4:4:4")

    def rows(begin: int, end: int) -> npt.NDArray[Any]:
        """Rows of the picture as codes or encoded floats, alpha straight where the format has it so."""
        block = pixels[begin:end]
        alpha = block[..., 3:]
        colour = block
        if straight:
            colour = np.divide(block[..., :3], alpha, out=np.zeros_like(block[..., :3]), where=alpha > 0)
        encoded = encode_srgb(colour)
        if file_format(path) != "png":
            return np.concatenate([encoded, alpha.clip(0.0, 1.0)], axis=2)
        coverage = np.rint(255 * alpha.clip(0.0, 1.0)).astype(np.uint8)
        return np.concatenate([dithered(encoded, left, top + begin), coverage], axis=2)

    _write(path, spec, metadata, rows)


def write_data(
    path: PathName,
    values: Float32s | npt.NDArray[np.uint8 | np.uint16],
    metadata: Mapping[str, str],
    half: bool,
    names: Sequence[str],
    bits: int = 16,
) -> None:
    """Write numbers as they are, (height, width, channels): in PNG codes, or from 0 to 1; else as floats.

    Args: half: floats of 16 bits. names: of the channels, in EXR files. bits: of a channel in PNG, 8 or 16.
    """
    oiio = openimageio()

    height, width, channels = values.shape
    kind = f"uint{bits}" if file_format(path) == "png" else "half" if half else "float"
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("oiio:ColorSpace", "data")
    if half:
        oiio.attribute("tiff:half", 1)  # which OpenImageIO otherwise takes for too uncommon
    if file_format(path) == "openexr":
        spec.channelnames = tuple(names)
    if file_format(path) == "png":
        spec.attribute("oiio:UnassociatedAlpha", 1)
        spec.attribute("png:filter", _DIFFERENCES_UPWARDS)  # smaller by 2 % in a third of the time
        spec.attribute("png:compressionLevel", 4)
    else:
        spec.attribute("compression", "zip")
    _write(path, spec, metadata, lambda begin, end: values[begin:end])


def image_bytes(name: str, write: Callable[..., None], *given: Any) -> bytes:
    """The bytes of the image file that `write(path, *arguments)` writes. Args: name: whose ending says the format."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        target = Path(folder) / name
        write(target, *given)
        return target.read_bytes()


def linear_png(values: npt.NDArray[np.uint8 | np.uint16]) -> bytes:
    """A PNG file of codes (height, width, channels) as they are, which says nothing of a colour space."""
    return image_bytes("data.png", write_data, values, {}, False, (), 8 * values.itemsize)


def _write(
    path: PathName,
    spec: Any,
    metadata: Mapping[str, str],
    pixel_rows: Callable[[int, int], npt.NDArray[Any]],
) -> None:
    """Write an image file, whole or not at all, a few rows at a time.

    Args:
        spec: OpenImageIO's, of the file.
        metadata: as far as the format holds it.
        pixel_rows: makes the rows from a first one to the one after the last.
    """
    oiio = openimageio()

    # The metadata, as each format can hold them.
    format_name = file_format(path)
    spec.attribute("DateTime", "")  # or OpenImageIO puts in the present time
    if format_name in ("openexr", "png"):
        for name, text in metadata.items():
            spec.attribute(NAMESPACE + name, printable(text))
    elif metadata:
        import json

        spec.attribute("ImageDescription", json.dumps(dict(metadata)))
    # The rows, into a file beside the target that replaces it when all is there.
    with atomic_path(path) as scratch:
        if format_name != "openexr":
            _reserve(scratch, spec.image_bytes() + _SPARE)
        output: Any = oiio.ImageOutput.create(format_name)
        done = output.open(str(scratch), spec)
        try:
            for begin in range(0, spec.height, _ROWS):
                end = min(begin + _ROWS, spec.height)
                done = done and output.write_scanlines(begin, end, 0, np.ascontiguousarray(pixel_rows(begin, end)))
        finally:
            done = output.close() and done
        reason = output.geterror()
        if not done or "Write error" in reason or not _complete(scratch, format_name, spec.height):
            import shutil

            full = shutil.disk_usage(scratch.parent).free < _SPARE  # which OpenImageIO does not say
            first_line = os.strerror(errno.ENOSPC) if full else reason.replace(str(scratch), "").strip().split("\n")[0]
            raise OutputError(f"{os.fspath(path)}: cannot write: {first_line or 'the disk took only a part of it'}")


def _reserve(scratch: Path, size: int) -> None:
    """Fail now if the disk has no room for `size` bytes: libjpeg answers a full disk by ending the process."""
    with scratch.open("wb") as file:
        for begin in range(0, size, _SPARE):
            file.write(bytes(min(_SPARE, size - begin)))


def _complete(scratch: Path, format_name: str, height: int) -> bool:
    """Whether the file has its end: writers buffer, and don't all report that the last bytes were refused."""
    oiio = openimageio()

    if format_name in _ENDS:
        return scratch.read_bytes().endswith(_ENDS[format_name])
    image = oiio.ImageInput.open(str(scratch))
    if image is None:
        oiio.geterror()
        return False
    last = image.read_scanlines(0, 0, height - 1, height, 0, 0, 1, "float")
    return last is not None and not image.geterror()
