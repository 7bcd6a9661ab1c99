"""Pictures on disk: a frame's layers, or plain pixels, in the format that the name's ending asks for.

EXR holds all layers, linear. PNG (8 bits), TIFF (16) and JPEG (8, quality 95) hold one layer of colours or fractions,
sRGB-encoded. Every file appears whole or not at all, and the same picture gives the same bytes: no time stamps.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import OptionError, OutputError, is_utf8, printable
from ..system.atomic import atomic_path, check_writable
from .frame import LAYERS, Frame
from .srgb import encode_srgb

Floats = npt.NDArray[np.float32]

FORMATS = {".exr": "openexr", ".png": "png", ".tif": "tiff", ".tiff": "tiff", ".jpg": "jpeg", ".jpeg": "jpeg"}
NAMESPACE = "obscurance:"
DATA = ("depth", "normal", "object_id")
CHANNELS = {"normal": "XYZ", "depth": "Z", "object_id": ("ID",)}
_BY_COUNT = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}
_ALWAYS_FLOAT = ("depth", "object_id")
_LARGEST_HALF = np.float32(65504.0)
_ENDS = {"png": b"IEND\xaeB`\x82", "jpeg": b"\xff\xd9"}
_ROWS = 64
_SPARE = 1 << 20


def check_image_target(
    path: str | os.PathLike[str], half: bool = False, layers: Sequence[str] | None = None
) -> tuple[str, ...] | None:
    """Find out before the work whether `write_frame` will be able to start; returns the layers it needs.

    Returns:
        The names of the layers that the file will hold, None for all there are.

    Raises:
        OptionError: an ending, or a layer, that cannot be written.
        OutputError: the folder is missing or refuses new files, or `path` is something other than a file.
    """
    format_name = _format(path)
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
    if not is_utf8(os.path.dirname(os.path.realpath(path))):
        raise OutputError(printable(f"{os.fspath(path)}: cannot write: an image's folder must have a name in UTF-8"))
    check_writable(path)
    return None if layers is None else tuple(layers)


def write_frame(
    path: str | os.PathLike[str],
    frame: Frame,
    metadata: Mapping[str, str],
    half: bool = False,
    layers: Sequence[str] | None = None,
) -> None:
    """Write a frame.

    An EXR file holds R, G, B, A of the beauty and `layer.channel` of every other layer: R, G, B of colours; X, Y, Z of
    normals; Z of depth; ID of object_id; Y of the rest. In the other formats the beauty has straight alpha (JPEG: none,
    over black); a background other than black, which is in the beauty already, makes it opaque.
    Only some rows are held in memory besides the frame.

    Args:
        path: the target; its ending is one of `FORMATS`.
        metadata: names and texts, such as the scene and the seed: attributes `obscurance:name` in EXR and PNG, a JSON
            object as the image description in TIFF and JPEG. `read_image` returns them.
        half: 16-bit floats in EXR (magnitudes above 65504 are clipped); depth and object_id stay 32-bit.
        layers: which to write; all of the frame's in EXR, the beauty in other formats.

    Raises:
        OptionError: an ending or a layer that cannot be written, or that the frame lacks.
        OutputError: the file cannot be written; an existing one is untouched.
    """
    chosen = check_image_target(path, half, layers)
    for name in chosen or ():
        if name not in frame.layers:
            raise OptionError("layers", "layers of the frame: " + ", ".join(frame.layers), name)
    if _format(path) == "openexr":
        names = [name for name in LAYERS if name in frame.layers] if chosen is None else list(chosen)
        _write_layers(path, {name: frame.layers[name] for name in names}, metadata, half)
    else:
        assert chosen is not None
        _write_picture(path, frame.layers[chosen[0]], metadata, opaque=any(frame.background))


def write_image(path: str | os.PathLike[str], pixels: npt.ArrayLike) -> None:
    """Write linear `pixels`, row 0 at the top, as an sRGB PNG, TIFF or JPEG.

    Args:
        pixels: (h, w) or (h, w, 1) grey, (h, w, 3) RGB, (h, w, 4) premultiplied RGBA.

    Raises:
        OptionError: another ending.
        OutputError: the file cannot be written; an existing one is untouched.
    """
    check_image_target(path, layers=("beauty",))
    whole = np.asarray(pixels, np.float32)
    _write_picture(path, whole.reshape(*whole.shape[:2], -1), {})


def channel_names(layer: str, count: int) -> tuple[str, ...]:
    """Names of a layer's channels in an EXR file."""
    suffixes = CHANNELS.get(layer, _BY_COUNT[count])
    return tuple(suffixes) if layer == "beauty" else tuple(f"{layer}.{suffix}" for suffix in suffixes)


def _format(path: str | os.PathLike[str]) -> str:
    try:
        return FORMATS[Path(path).suffix.lower()]
    except KeyError:
        raise OptionError("output", "a name ending in " + " ".join(FORMATS), os.fspath(path)) from None


def _write_layers(
    path: str | os.PathLike[str], layers: Mapping[str, Floats], metadata: Mapping[str, str], half: bool
) -> None:
    import OpenImageIO as oiio

    height, width = next(iter(layers.values())).shape[:2]
    names: list[str] = []
    formats: list[str] = []
    for name, layer in layers.items():
        names += channel_names(name, layer.shape[2])
        formats += ["half" if half and name not in _ALWAYS_FLOAT else "float"] * layer.shape[2]
    spec = oiio.ImageSpec(width, height, len(names), "float")
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(oiio.TypeDesc(each) for each in formats)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")

    def rows(first: int, end: int) -> Floats:
        parts = []
        for name, layer in layers.items():
            clipped = half and name not in _ALWAYS_FLOAT
            parts.append(layer[first:end].clip(-_LARGEST_HALF, _LARGEST_HALF) if clipped else layer[first:end])
        return np.concatenate(parts, axis=2)

    _write(path, spec, metadata, rows)


def _write_picture(
    path: str | os.PathLike[str], pixels: Floats, metadata: Mapping[str, str], opaque: bool = False
) -> None:
    import OpenImageIO as oiio

    opaque = opaque or _format(path) == "jpeg" or (pixels.shape[2] == 4 and _has_background(pixels))
    straight = pixels.shape[2] == 4 and not opaque
    if pixels.shape[2] == 4 and not straight:
        pixels = pixels[..., :3]
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, "uint16" if _format(path) == "tiff" else "uint8")
    spec.attribute("oiio:ColorSpace", "srgb_rec709_scene")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if _format(path) == "jpeg":
        spec.attribute("Compression", "jpeg:95")
        spec.attribute("jpeg:subsampling", "4:4:4")

    def rows(first: int, end: int) -> Floats:
        block = pixels[first:end]
        if not straight:
            return encode_srgb(block)
        alpha = block[..., 3:]
        colour = np.divide(block[..., :3], alpha, out=np.zeros_like(block[..., :3]), where=alpha > 0)
        return np.concatenate([encode_srgb(colour), alpha.clip(0.0, 1.0)], axis=2)

    _write(path, spec, metadata, rows)


def _has_background(pixels: Floats) -> bool:
    """Whether there is colour where the alpha is 0, which straight alpha cannot hold."""
    return bool((pixels[..., :3].any(axis=2) & (pixels[..., 3] == 0)).any())


def _write(
    path: str | os.PathLike[str], spec: Any, metadata: Mapping[str, str], rows: Callable[[int, int], Floats]
) -> None:
    import OpenImageIO as oiio

    format_name = _format(path)
    spec.attribute("DateTime", "")  # or OpenImageIO puts in the present time
    if format_name in ("openexr", "png"):
        for name, text in metadata.items():
            spec.attribute(NAMESPACE + name, printable(text))
    elif metadata:
        spec.attribute("ImageDescription", json.dumps(dict(metadata)))
    with atomic_path(path) as scratch:
        if format_name != "openexr":
            _reserve(scratch, spec.image_bytes() + _SPARE)
        output: Any = oiio.ImageOutput.create(format_name)
        done = output.open(str(scratch), spec)
        try:
            for first in range(0, spec.height, _ROWS):
                end = min(first + _ROWS, spec.height)
                done = done and output.write_scanlines(first, end, 0, np.ascontiguousarray(rows(first, end)))
        finally:
            done = output.close() and done
        reason = output.geterror()
        if not done or "Write error" in reason or not _complete(scratch, format_name, spec.height):
            first_line = reason.replace(str(scratch), "").strip().split("\n")[0]
            raise OutputError(f"{os.fspath(path)}: cannot write: {first_line or 'the disk took only a part of it'}")


def _reserve(scratch: Path, size: int) -> None:
    """Fail now if the disk has no room for `size` bytes: libjpeg answers a full disk by ending the process."""
    with scratch.open("wb") as file:
        for first in range(0, size, _SPARE):
            file.write(bytes(min(_SPARE, size - first)))
        file.flush()


def _complete(scratch: Path, format_name: str, height: int) -> bool:
    """Whether the file has its end: writers buffer, and don't all tell that the last bytes were refused."""
    import OpenImageIO as oiio

    if format_name in _ENDS:
        return scratch.read_bytes().endswith(_ENDS[format_name])
    image = oiio.ImageInput.open(str(scratch))
    if image is None:
        oiio.geterror()
        return False
    last = image.read_scanlines(0, 0, height - 1, height, 0, 0, 1, "float")
    return last is not None and not image.geterror()
