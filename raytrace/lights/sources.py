"""Light sources: typed, checked, packed to rows for kernels; and the photometry law.

    sun = Directional(direction=(0, -1, 0), intensity=3)          # shines downwards
    lamp = PointLight(position=(0, 4, 0), intensity=(80, 75, 60))  # watts per steradian: falls off as 1/d²

A light's RGB intensity is what it sends out; `incident` (in `raytrace.lights.kernels`) is what arrives: intensity times
radial and angular attenuation, before the surface's cosine. Light is attenuated on its way to the surface only.
Source: (12.8), (12.26); the lecture notes on light sources.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import model_validator

from ..errors import OptionError, numbers
from ..system.parameters import Direction, HalfAngle, Length, NonNegative, Parameters, Point, Radiance
from ..types import Float64s, Int64s
from . import layout


class PackedLight(NamedTuple):
    """A light as kernels take it: integer kind, and a float64 row of `WIDTH`."""

    kind: int
    row: Float64s


class BaseLight(Parameters):
    """The parameter of every light: an RGB intensity ≥ 0 (one number means white)."""

    intensity: Radiance = (1.0, 1.0, 1.0)


class LightSource(BaseLight):
    """A light that kernels read as a row of `raytrace.lights.layout`."""

    kind: ClassVar[int]

    def pack(self) -> PackedLight:
        """The kind and row that `raytrace.lights.kernels` takes."""
        row = np.zeros(layout.WIDTH)
        row[layout.INTENSITY : layout.INTENSITY + 3] = self.intensity
        row[layout.DIFFUSE :] = 1.0
        self._write(row)
        return PackedLight(self.kind, row)

    def _write(self, row: Float64s) -> None:
        """Write the columns after the intensity."""


class _Directed(LightSource):
    """A light that comes from somewhere; its terms may have colours of their own, as OpenGL's lights do.

    `diffuse`, `specular`: RGB intensity of what is reflected diffusely and in highlights, `intensity` unless given.
    `ambient`: what the light adds to I_a, everywhere, neither attenuated nor shadowed.
    """

    ambient: Radiance = (0.0, 0.0, 0.0)
    diffuse: Radiance | None = None
    specular: Radiance | None = None

    def _write(self, row: Float64s) -> None:
        colours = [self.intensity if colour is None else colour for colour in (self.diffuse, self.specular)]
        brightest = np.max(colours, axis=0)
        row[layout.INTENSITY : layout.INTENSITY + 3] = brightest
        row[layout.DIFFUSE :] = np.divide(colours, brightest, out=np.ones((2, 3)), where=brightest > 0).ravel()


class _Local(_Directed):
    """A light with a place and radial attenuation 1/(a0 + a1 d + a2 d²); (0, 0, 1) is the physical law.

    `range`: the distance at which it ends: attenuation times 1 − (d/range)⁴, zero beyond (glTF, KHR_lights_punctual).
    """

    position: Point
    attenuation: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 1.0)
    range: Length | None = None

    def _write(self, row: Float64s) -> None:
        super()._write(row)
        row[layout.POSITION : layout.POSITION + 3] = self.position
        row[layout.RADIAL : layout.RADIAL + 3] = self.attenuation
        row[layout.INVERSE_RANGE] = 0.0 if self.range is None else 1.0 / self.range

    @model_validator(mode="after")
    def _attenuates(self) -> _Local:
        if not any(self.attenuation):
            raise OptionError("attenuation", "a0, a1, a2 not all zero", list(self.attenuation), type(self).__name__)
        return self


class PointLight(_Local):
    """Sends the same intensity in all directions."""

    light: Literal["point"] = "point"
    kind: ClassVar[int] = layout.POINT


class SpotLight(_Local):
    """A point light within `half_angle` (degrees, in (0, 90]) of `direction`, times cos^exponent of the angle."""

    light: Literal["spot"] = "spot"
    kind: ClassVar[int] = layout.SPOT
    direction: Direction
    half_angle: HalfAngle
    exponent: NonNegative = 0.0

    def _write(self, row: Float64s) -> None:
        super()._write(row)
        row[layout.DIRECTION : layout.DIRECTION + 3] = _unit(self.direction)
        angle = radians(self.half_angle)
        row[layout.COS_HALF_ANGLE], row[layout.HALF_ANGLE] = max(0.0, cos(angle)), angle
        row[layout.EXPONENT] = self.exponent


class DirectionalLight(_Directed):
    """Infinitely distant: `direction` is the way its light travels; no attenuation."""

    light: Literal["directional"] = "directional"
    kind: ClassVar[int] = layout.DIRECTIONAL
    direction: Direction

    def _write(self, row: Float64s) -> None:
        super()._write(row)
        row[layout.DIRECTION : layout.DIRECTION + 3] = _unit(self.direction)


class AmbientLight(LightSource):
    """I_a: the same from everywhere, reflected as k_a I_a."""

    light: Literal["ambient"] = "ambient"
    kind: ClassVar[int] = layout.AMBIENT


def pack_lights(lights: Sequence[LightSource]) -> tuple[Int64s, Float64s]:
    """Kinds (k,) int64 and rows (k, WIDTH) float64 of lights, and behind them of what these add to ambient light."""
    ambient = [AmbientLight(intensity=each.ambient) for each in lights if isinstance(each, _Directed)]
    packed = [light.pack() for light in (*lights, *(each for each in ambient if any(each.intensity)))]
    kinds = np.array([p.kind for p in packed], np.int64)
    return kinds, np.array([p.row for p in packed], np.float64).reshape(-1, layout.WIDTH)


def irradiance(
    intensity: npt.ArrayLike, n: npt.ArrayLike, l: npt.ArrayLike, distance: npt.ArrayLike
) -> npt.NDArray[Any]:
    """E = I ⟨n·l⟩/d² (12.8), W/m².

    Args: intensity I in W/sr, of any shape (…,); vectors n and l (…, 3), which are normalised here, zero receives
    nothing; distance d > 0 in metres (…,).

    Raises: OptionError: n or l is not of finite numbers (…, 3).
    """
    from ..mesh.normals import normalize

    units = []
    for name, given in (("n", n), ("l", l)):
        values = numbers(given, "irradiance", name, "an array of numbers (…, 3)")
        if values.shape[-1:] != (3,) or not np.isfinite(values).all():
            raise OptionError(name, "finite numbers (…, 3)", f"{values.tolist()}"[:60], "irradiance")
        units.append(normalize(values))
    cosine = np.maximum(0.0, np.sum(units[0] * units[1], axis=-1))
    return np.asarray(np.multiply(intensity, cosine) / np.square(distance))


def _unit(direction: tuple[float, float, float]) -> Float64s:
    from ..mesh.normals import normalize

    return normalize(np.array(direction))
