"""Sky gradients and an image all around, packed for kernels; the image is filtered once: irradiance as spherical
harmonics, and maps blurred for gloss.

Source: Ramamoorthi & Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps".
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError, OptionError
from ..image.read import read_image
from ..types import Float32s, Float64s
from .layout import MAP_HEIGHT, MAP_SLOPE, MAP_WIDTH, MAPS, SKY_WIDTH
from .sources import BaseLight, EnvironmentLight, SkyLight

_NORMS = np.array([4, 4 / 3, 4 / 3, 4 / 3, 4 / 15, 4 / 15, 16 / 5, 4 / 15, 16 / 15]) * np.pi  # 1/c² of Y = c p
_COLUMNS = 256
_COSINE = np.array([1, 2 / 3, 2 / 3, 2 / 3, 1 / 4, 1 / 4, 1 / 4, 1 / 4, 1 / 4])  # of the clamped cosine over π


def pack_environment(lights: Sequence[BaseLight]) -> tuple[Float64s, Float64s, Float32s, Float64s]:
    """The sky gradients and the image among `lights`: the last four of `raytrace.shade.records.Lights`.

    Raises:
        InputError: the image cannot be read.
        OptionError: there are two images.
    """
    skies = np.array([light.row() for light in lights if isinstance(light, SkyLight)]).reshape(-1, SKY_WIDTH)
    images = [light for light in lights if isinstance(light, EnvironmentLight)]
    if not images:
        none = np.empty((0, MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
        return skies, np.empty((0, 3)), none, np.eye(3)
    if len(images) > 1:
        raise OptionError("lights", "one environment image at most", f"{len(images)}", "scene")
    frame = images[0].frame()
    image = read_environment(images[0].image) * np.array(images[0].intensity)
    return skies, irradiance_harmonics(image, frame), blurred_maps(image), frame


def read_environment(path: Path) -> Float64s:
    """A latitude–longitude image as RGB (MAP_HEIGHT, MAP_WIDTH, 3), linear: means over its pixels.

    Raises: InputError: as `read_image`, or the image is not twice as wide as it is high.
    """
    layers, _ = read_image(path)
    if "beauty" not in layers:
        raise InputError(path, "channels", "red, green and blue", ", ".join(layers))
    image = layers["beauty"]
    height, width, channels = image.shape
    if width != 2 * height:
        raise InputError(path, "size", "twice as wide as high, 360° by 180°", f"{width}×{height}")
    rgb = image[..., :3] if channels >= 3 else np.broadcast_to(image[..., :1], (height, width, 3))
    if not 0 <= rgb.min() <= rgb.max() < np.inf:
        raise InputError(path, "pixels", "finite numbers, none negative", "others")
    strips = (rgb[:, first : first + _COLUMNS] for first in range(0, width, _COLUMNS))  # float64 of all is large
    rows = [resampled(strip.astype(np.float64), MAP_HEIGHT, 0) for strip in strips]
    return resampled(np.concatenate(rows, axis=1), MAP_WIDTH, 1)


def resampled(image: Float64s, size: int, axis: int) -> Float64s:
    """Means over `size` equal parts of an axis, of values that are constant over each of its pixels."""
    rows = np.moveaxis(image, axis, 0)
    integral = np.concatenate([np.zeros((1, *rows.shape[1:])), np.cumsum(rows, axis=0)])
    places = np.linspace(0, len(rows), size + 1)
    below = np.minimum(places.astype(int), len(rows) - 1)
    at = integral[below] + (places - below).reshape(-1, *[1] * (rows.ndim - 1)) * rows[below]
    return np.moveaxis(np.diff(at, axis=0) * size / len(rows), 0, axis)


def directions(frame: Float64s) -> tuple[Float64s, Float64s]:
    """Unit directions (MAP_HEIGHT, MAP_WIDTH, 3) of a map's texels in a `frame`, and solid angles (MAP_HEIGHT, 1)."""
    edges = np.cos(np.linspace(0, np.pi, MAP_HEIGHT + 1))
    theta = (np.arange(MAP_HEIGHT)[:, None] + 0.5) * np.pi / MAP_HEIGHT
    phi = ((np.arange(MAP_WIDTH) + 0.5) / MAP_WIDTH - 0.5) * 2 * np.pi
    local = np.stack(np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)), -1)
    return np.asarray(local @ frame), (-np.diff(edges) * 2 * np.pi / MAP_WIDTH)[:, None]


def irradiance_harmonics(image: Float64s, frame: Float64s) -> Float64s:
    """Coefficients (9, 3) of (1/π) ∫ L ⟨n·d⟩ dω for 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y² of n."""
    d, solid = directions(frame)
    x, y, z = np.moveaxis(d, -1, 0)
    basis = np.stack([np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y])
    return np.einsum("khw,hwc->kc", basis * solid, image) * (_COSINE / _NORMS)[:, None]


def blurred_maps(image: Float64s) -> Float32s:
    """The image as mirrored by facets of slope 0, `MAP_SLOPE`, and twice as much each: float32 (MAPS, …, 3)."""
    maps = [image, *(_blurred(image, MAP_SLOPE * 2**level) for level in range(MAPS - 1))]
    return np.ascontiguousarray(maps, np.float32)


def _blurred(image: Float64s, slope: float) -> Float64s:
    """Means over what Beckmann facets of RMS `slope` mirror at normal incidence, at the same angle everywhere.

    The kernel depends on two latitudes and a difference of longitudes, along which it is a product of spectra.
    """
    theta = (np.arange(MAP_HEIGHT) + 0.5) * np.pi / MAP_HEIGHT
    turn = np.arange(MAP_WIDTH) * 2 * np.pi / MAP_WIDTH
    edges = np.cos(np.linspace(0, np.pi, MAP_HEIGHT + 1))
    source = np.fft.rfft(image * -np.diff(edges)[:, None, None], axis=1)
    out = np.empty_like(image)
    for row, latitude in enumerate(theta):
        cosine = np.cos(latitude) * np.cos(theta)[:, None] + np.sin(latitude) * np.sin(theta)[:, None] * np.cos(turn)
        half = np.maximum(1e-9, (1 + cosine) / 2)  # cos² of the angle of the halfway vector
        weight = np.exp(-(1 / half - 1) / slope**2) / half**2 * np.maximum(0, cosine)
        weight /= np.sum(weight * -np.diff(edges)[:, None])
        spectrum = np.fft.rfft(weight, axis=1)
        out[row] = np.fft.irfft(np.einsum("hk,hkc->kc", spectrum, source), MAP_WIDTH, axis=0)
    return np.maximum(0.0, out)
