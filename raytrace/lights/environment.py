"""Light from all around, of a sky or an image: what arrives at a surface, and what a glossy one mirrors of it.

The image is filtered once: irradiance as spherical harmonics, and maps blurred for gloss. All of it is as I_a is: light
that is L in every direction is L. Rows of skies are as `raytrace.lights.kernels` has them.

Source: Ramamoorthi & Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps".
"""

from collections.abc import Sequence
from math import acos, asin, atan2, cos, erf, exp, floor, log2, pi, sqrt
from pathlib import Path

import numpy as np

from ..errors import InputError, OptionError
from ..image.read import read_image
from ..kernel.jit import inline
from ..kernel.vector import add, dot, load, scale, subtract, triple
from ..types import Float32s, Float64s
from .kernels import GROUND, HORIZON, MAP_HEIGHT, MAP_SLOPE, MAP_WIDTH, MAPS, SKY_WIDTH, UP, ZENITH
from .sources import BaseLight, EnvironmentLight, SkyLight

_NORMS = np.array([4, 4 / 3, 4 / 3, 4 / 3, 4 / 15, 4 / 15, 16 / 5, 4 / 15, 16 / 15]) * np.pi  # 1/c² of Y = c p
_COLUMNS = 256
_COSINE = np.array([1, 2 / 3, 2 / 3, 2 / 3, 1 / 4, 1 / 4, 1 / 4, 1 / 4, 1 / 4])  # of the clamped cosine over π


def pack_environment(lights: Sequence[BaseLight]) -> tuple[Float64s, Float64s, Float32s, Float64s]:
    """The sky gradients and the image among `lights`: the last four of `raytrace.shade.layout.Lights`.

    Raises: InputError: the image cannot be read. OptionError: there are two images.
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
    maps = [image, *(_blurred(image, MAP_SLOPE * 2**level) for level in range(MAPS - 1))]
    return skies, irradiance_harmonics(image, frame), np.ascontiguousarray(maps, np.float32), frame


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
    strips = (rgb[:, left : left + _COLUMNS] for left in range(0, width, _COLUMNS))  # float64 of all is large
    resampled_strips = [resampled(strip.astype(np.float64), MAP_HEIGHT, 0) for strip in strips]
    return resampled(np.concatenate(resampled_strips, axis=1), MAP_WIDTH, 1)


def resampled(image: Float64s, size: int, axis: int) -> Float64s:
    """Means over `size` equal parts of an axis, of values that are constant over each of its pixels."""
    pixel_rows = np.moveaxis(image, axis, 0)
    integral = np.concatenate([np.zeros((1, *pixel_rows.shape[1:])), np.cumsum(pixel_rows, axis=0)])
    bounds = np.linspace(0, len(pixel_rows), size + 1)
    below = np.minimum(bounds.astype(int), len(pixel_rows) - 1)
    at = integral[below] + (bounds - below).reshape(-1, *[1] * (pixel_rows.ndim - 1)) * pixel_rows[below]
    return np.moveaxis(np.diff(at, axis=0) * size / len(pixel_rows), 0, axis)


def irradiance_harmonics(image: Float64s, frame: Float64s) -> Float64s:
    """Coefficients (9, 3) of (1/π) ∫ L ⟨n·d⟩ dω for 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y² of n."""
    theta, bands = _latitudes()
    sine = np.sin(theta)[:, None]
    phi = ((np.arange(MAP_WIDTH) + 0.5) / MAP_WIDTH - 0.5) * 2 * np.pi
    local = np.broadcast_arrays(sine * np.sin(phi), sine * np.cos(phi), np.cos(theta)[:, None])
    x, y, z = np.moveaxis(np.stack(local, -1) @ frame, -1, 0)
    basis = np.stack([np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y])
    weighted = basis * (bands * 2 * np.pi / MAP_WIDTH)[:, None]
    return np.asarray(np.einsum("khw,hwc->kc", weighted, image) * (_COSINE / _NORMS)[:, None])


def _latitudes() -> tuple[Float64s, Float64s]:
    """Angles of a map's rows from its upper edge, and solid angles of the rows over 2π."""
    theta = (np.arange(MAP_HEIGHT) + 0.5) * np.pi / MAP_HEIGHT
    return theta, -np.diff(np.cos(np.linspace(0, np.pi, MAP_HEIGHT + 1)))


def _blurred(image: Float64s, slope: float) -> Float64s:
    """An environment blurred as a rough mirror shows it: means over what Beckmann facets of RMS `slope` mirror.

    It is blurred as at normal incidence, by the same angle everywhere. The kernel depends on two latitudes and a
    difference of longitudes, along which it is a product of spectra.
    """
    theta, bands = _latitudes()
    turn = np.arange(MAP_WIDTH) * 2 * np.pi / MAP_WIDTH
    source = np.fft.rfft(image * bands[:, None, None], axis=1)
    out = np.empty_like(image)
    for row, latitude in enumerate(theta):
        cosine = np.cos(latitude) * np.cos(theta)[:, None] + np.sin(latitude) * np.sin(theta)[:, None] * np.cos(turn)
        half = np.maximum(1e-9, (1 + cosine) / 2)  # cos² of the angle of the halfway vector
        weight = np.exp(-(1 / half - 1) / slope**2) / half**2 * np.maximum(0, cosine)
        weight /= np.sum(weight * bands[:, None])
        spectrum = np.fft.rfft(weight, axis=1)
        out[row] = np.fft.irfft(np.einsum("hk,hkc->kc", spectrum, source), MAP_WIDTH, axis=0)
    return np.maximum(0.0, out)


@inline
def gradient(sky, above, rise):
    """The colour of a sky: ground + (horizon − ground)·above + (zenith − horizon)·rise, exact where all three are
    equal."""
    ground = triple(sky, GROUND)
    horizon = triple(sky, HORIZON)
    zenith = triple(sky, ZENITH)
    over_ground = add(ground, scale(above, subtract(horizon, ground)))
    return add(over_ground, scale(rise, subtract(zenith, horizon)))


@inline
def sky_irradiance(sky, n):
    """(1/π) ∫ L(d) ⟨n·d⟩ dω of a sky gradient, closed.

    With c = n·up, a hemisphere of light brings (1 + c)/2, and light that grows as ⟨d·up⟩ brings
    (2/3π)(√(1 − c²) + c asin c) + c/3: half of E|d·up||d·n| of a Gaussian vector, and of its odd part.
    """
    c = max(-1.0, min(1.0, dot(n, triple(sky, UP))))
    return gradient(sky, 0.5 * (1.0 + c), 2.0 / (3.0 * pi) * (sqrt(1.0 - c * c) + c * asin(c)) + c / 3.0)


@inline
def sky_radiance(sky, d, slope):
    """L of a sky gradient about a unit direction d, blurred by the reflection of facets of RMS `slope`.

    Directions spread by σ = √2 slope about d. The first two moments of their height over the horizon are those of the
    heat kernel on the sphere, exp(−l(l + 1)σ²/2); they are taken for Gaussian.
    """
    variance = 2.0 * slope * slope
    height = dot(d, triple(sky, UP))
    square = 1.0 / 3.0 + (height * height - 1.0 / 3.0) * exp(-3.0 * variance)
    height *= exp(-variance)
    deviation = sqrt(max(1e-12, square - height * height))
    z = height / deviation
    above = 0.5 * (1.0 + erf(z / sqrt(2.0)))
    return gradient(sky, above, height * above + deviation * exp(-0.5 * z * z) / sqrt(2.0 * pi))


@inline
def harmonic_irradiance(harmonics, n):
    """(1/π) ∫ L(d) ⟨n·d⟩ dω of an image, from its nine coefficients (Ramamoorthi & Hanrahan 2001)."""
    x, y, z = n
    basis = (1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y)
    total = (0.0, 0.0, 0.0)
    for k in range(9):
        total = add(total, scale(basis[k], triple(harmonics[k], 0)))
    return (max(0.0, total[0]), max(0.0, total[1]), max(0.0, total[2]))


@inline
def map_radiance(maps, frame, d, slope):
    """L of an image about a unit direction d, blurred for facets of RMS `slope`: bilinear, linear between two maps."""
    right = triple(frame[0], 0)
    front = triple(frame[1], 0)
    up = triple(frame[2], 0)
    u = 0.5 + atan2(dot(d, right), dot(d, front)) / (2.0 * pi)
    v = acos(max(-1.0, min(1.0, dot(d, up)))) / pi
    level = slope / MAP_SLOPE
    if level > 1.0:  # slopes double from the second map on
        level = min(MAPS - 1.0, 1.0 + log2(level))
    lower = min(int(level), MAPS - 2)
    part = level - lower
    return add(scale(1.0 - part, bilinear_map(maps[lower], u, v)), scale(part, bilinear_map(maps[lower + 1], u, v)))


@inline
def bilinear_map(texels, u, v):
    """Bilinear lookup in a map (MAP_HEIGHT, MAP_WIDTH, 3), which is periodic along u."""
    x = u * MAP_WIDTH - 0.5
    y = max(0.0, min(MAP_HEIGHT - 1.0, v * MAP_HEIGHT - 0.5))
    left = floor(x)
    upper = min(int(y), MAP_HEIGHT - 2)
    s = x - left
    t = y - upper
    right = (left + 1) % MAP_WIDTH
    left = left % MAP_WIDTH
    return add(
        scale(1.0 - t, add(scale(1.0 - s, load(texels[upper], left)), scale(s, load(texels[upper], right)))),
        scale(t, add(scale(1.0 - s, load(texels[upper + 1], left)), scale(s, load(texels[upper + 1], right)))),
    )


@inline
def cone_visibility(w, aside, slope):
    """The part of what is mirrored that is open, where w is, and the mirror direction is `aside` of the bent normal.

    What is open is taken for a cone about the bent normal that w is the cosine-weighted part of, sin²θ = w; what is
    mirrored for one of half-angle √2 slope. 1 where w is 1, 0 where it is 0. After Oat & Sander 2007.
    """
    open_ = asin(sqrt(max(0.0, min(1.0, w))))
    mirrored = min(0.5 * pi, max(0.05, sqrt(2.0) * slope))
    t = max(0.0, min(1.0, 0.5 + (open_ + w * mirrored - aside) / (2.0 * mirrored)))
    narrow = (1.0 - sqrt(max(0.0, 1.0 - w))) / (1.0 - cos(mirrored))
    return t * t * (3.0 - 2.0 * t) * min(1.0, narrow)
