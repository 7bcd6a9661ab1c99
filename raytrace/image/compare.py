"""Differences of two pictures: OpenImageIO's error figures, and FLIP (Andersson et al. 2020)."""

import os
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..errors import InputError, OptionError
from ..system.atomic import PathName
from ..system.checks import check_memory, check_outputs
from ..types import Float32s
from .colour import decode_srgb
from .formats import openimageio
from .read import open_image, read_image
from .write import check_image_target, write_image

_READ, _FLIP = 52, 150  # bytes that a pixel takes while two pictures are read, and FLIP takes besides
Metric = Literal["flip", "rms", "max"]


@dataclass(frozen=True)
class Comparison:
    """Figures over all pixels and the channels R, G, B of linear colour.

    Attributes:
        mean_error: mean of the absolute differences.
        rms_error: root of the mean of the squared differences.
        max_error: largest absolute difference.
        psnr: peak signal-to-noise ratio, decibels, the peak being the largest value in either picture and at least 1;
            inf for equal pictures.
        flip: mean of the FLIP map, in [0, 1]: the difference that an observer sees who alternates between the two
            (Andersson et al. 2020; for high dynamic range, 2021), 67 pixels a degree, luminances up to 2.
    """

    mean_error: float
    rms_error: float
    max_error: float
    psnr: float
    flip: float

    def within(self, threshold: float, metric: Metric = "flip") -> bool:
        """Whether the error by `metric` is at most `threshold`. Raises: OptionError."""
        figures = {"flip": self.flip, "rms": self.rms_error, "max": self.max_error}
        if metric not in figures:
            raise OptionError("metric", "one of " + ", ".join(figures), metric)
        if not threshold >= 0.0:
            raise OptionError("threshold", "a number in [0, inf)", threshold)
        return figures[metric] <= threshold


def compare(a: PathName, b: PathName, difference: PathName | None = None) -> Comparison:
    """Compare two image files: their colours over black, linear, whatever their formats. `a` is the reference.

    Alpha and layers other than the beauty are not compared.

    Args: difference: a PNG, TIFF or JPEG to write the FLIP map to, from black, equal, by magenta to yellow.

    Raises: InputError: a file cannot be read, holds values that are not finite, or the sizes differ. MemoryLimitError.
        OptionError, OutputError: `difference` cannot be written, or is `a` or `b`.
    """
    oiio = openimageio()

    if difference is not None:
        check_image_target(difference, layers=("beauty",))
        check_outputs({"--difference": difference}, (a, b))
    width, height = _size(a)
    other_size = _size(b)
    if other_size != (width, height):
        expected = f"{width}×{height} pixels as in {os.fspath(a)}"
        raise InputError(os.fspath(b), "size", expected, "{}×{} pixels".format(*other_size))
    work = f"to compare {width:,}×{height:,} pixels"
    check_memory(os.fspath(a), _READ * width * height, work)
    reference = _buffer(_colour(a))
    compared = _buffer(_colour(b))
    figures = oiio.ImageBufAlgo.compare(reference, compared, 0.0, 0.0)
    seen = _buffer(np.zeros((height, width, 1), np.float32))
    if figures.maxerror:
        check_memory(os.fspath(a), _FLIP * width * height, work)
        seen = oiio.ImageBufAlgo.FLIP_diff(reference, compared)
    if difference is not None:
        coloured: Any = oiio.ImageBufAlgo.color_map(seen, 0, "magma")
        write_image(difference, decode_srgb(coloured.get_pixels(oiio.FLOAT)))
    flip = np.mean(seen.get_pixels(oiio.FLOAT), dtype=np.float64)
    return Comparison(*map(float, (figures.meanerror, figures.rms_error, figures.maxerror, figures.PSNR, flip)))


def _size(path: PathName) -> tuple[int, int]:
    spec = open_image(path).spec()
    return spec.width, spec.height


def _colour(path: PathName) -> Float32s:
    """Linear RGB over black, (h, w, 3)."""
    layers, _ = read_image(path)
    if "beauty" not in layers:
        raise InputError(os.fspath(path), "channels", "R, G, B or a grey channel", "layers " + ", ".join(layers))
    pixels = layers["beauty"]
    colour = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    broken = int((~np.isfinite(colour)).any(axis=2).sum())
    if broken:
        raise InputError(os.fspath(path), "pixels", "finite values", f"{broken} that are infinite or not numbers")
    return np.ascontiguousarray(colour)


def _buffer(pixels: Float32s) -> Any:
    """An image (height, width, 3) of linear colours as OpenImageIO takes it."""
    oiio = openimageio()

    buffer = oiio.ImageBuf(pixels)
    buffer.specmod().attribute("oiio:ColorSpace", "lin_rec709_scene")
    return buffer
