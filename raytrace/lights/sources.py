"""Light sources: typed, checked, packed to rows for kernels; and the photometry law.

    sun = DirectionalLight(direction=(0, -1, 0), intensity=3)     # shines downwards
    lamp = PointLight(position=(0, 4, 0), intensity=(80, 75, 60))  # watts per steradian: falls off as 1/d²
    sky = SkyLight(zenith=(0.2, 0.4, 0.9), horizon=(0.8, 0.8, 0.8), ground=0.2)
    studio = EnvironmentLight(image="studio.exr", intensity=0.5)

A light's RGB intensity is what it sends out; `incident` (in `raytrace.lights.kernels`) is what arrives: intensity times
radial and angular attenuation, before the surface's cosine. Light is attenuated on its way to the surface only.

Of a sky or an image a surface reflects as of ambient light, k_a I_a w, with I_a the cosine-weighted mean over the
hemisphere about its bent normal, or its normal; what a glossy material mirrors comes from the mirror direction.
Source: (12.8), (12.26); the lecture notes on light sources.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, tan
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
import numpy.typing as npt

from ..errors import OptionError, numbers
from ..mesh.normals import normalize
from ..system.parameters import (
    Diameter,
    Direction,
    HalfAngle,
    Length,
    NonNegative,
    Parameters,
    Point,
    Radiance,
    made_of,
)
from ..types import Float64s, Int64s
from .kernels import (
    AMBIENT,
    COS_HALF_ANGLE,
    DIFFUSE,
    DIRECTION,
    DIRECTIONAL,
    EXPONENT,
    HALF_ANGLE,
    INTENSITY,
    INVERSE_RANGE,
    POINT,
    POSITION,
    RADIAL,
    RADIUS,
    SPOT,
    WIDTH,
)


class BaseLight(Parameters):
    """The parameter of every light: an RGB intensity ≥ 0 (one number means white)."""

    intensity: Radiance = (1.0, 1.0, 1.0)


class LightSource(BaseLight):
    """A light that kernels read as a row of `raytrace.lights.kernels`."""

    kind: ClassVar[int]

    def pack(self) -> tuple[int, Float64s]:
        """The kind and row (WIDTH,) that `raytrace.lights.kernels` takes."""
        row = np.zeros(WIDTH)
        self._write(row)
        return self.kind, row

    def _write(self, row: Float64s) -> None:
        """Fill in the columns of `row`, zeros (WIDTH,), that the light has."""
        row[INTENSITY : INTENSITY + 3] = self.intensity
        row[DIFFUSE:] = 1.0


class _Directed(LightSource):
    """A light that comes from somewhere; its terms may have colours of their own, as OpenGL's lights do.

    `diffuse`, `specular`: RGB intensity of what is reflected diffusely and in highlights, `intensity` unless given.
    `ambient`: what the light adds to I_a, everywhere, neither attenuated nor shadowed.
    """

    ambient: Radiance = (0.0, 0.0, 0.0)
    diffuse: Radiance | None = None
    specular: Radiance | None = None

    def _write(self, row: Float64s) -> None:
        """Intensity is the brightest of both terms' colours, and DIFFUSE their ratios to it."""
        colours = [self.intensity if colour is None else colour for colour in (self.diffuse, self.specular)]
        brightest = np.max(colours, axis=0)
        row[INTENSITY : INTENSITY + 3] = brightest
        row[DIFFUSE:] = np.divide(colours, brightest, out=np.ones((2, 3)), where=brightest > 0).ravel()


class _Local(_Directed):
    """A light with a place and radial attenuation 1/(a0 + a1 d + a2 d²); (0, 0, 1) is the physical law.

    `range`: the distance at which it ends: attenuation times 1 − (d/range)⁴, zero beyond (glTF, KHR_lights_punctual).
    `radius`: of the disc, facing the point that it lights, which casts the shadows; 0 casts hard ones.
    """

    position: Point
    attenuation: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 1.0)
    range: Length | None = None
    radius: NonNegative = 0.0

    def _write(self, row: Float64s) -> None:
        super()._write(row)
        row[POSITION : POSITION + 3] = self.position
        row[RADIAL : RADIAL + 3] = self.attenuation
        row[RADIUS] = self.radius
        row[INVERSE_RANGE] = 0.0 if self.range is None else 1.0 / self.range

    def check(self) -> None:
        """Check that some coefficient of the attenuation is above 0. Raises: OptionError."""
        if not any(self.attenuation):
            raise OptionError("attenuation", "a0, a1, a2 not all zero", list(self.attenuation), type(self).__name__)


class PointLight(_Local):
    """Sends the same intensity in all directions."""

    light: Literal["point"] = "point"
    kind: ClassVar[int] = POINT


class SpotLight(_Local):
    """A point light within `half_angle` (degrees, in (0, 90]) of `direction`, times cos^exponent of the angle."""

    light: Literal["spot"] = "spot"
    kind: ClassVar[int] = SPOT
    direction: Direction
    half_angle: HalfAngle
    exponent: NonNegative = 0.0

    def _write(self, row: Float64s) -> None:
        super()._write(row)
        row[DIRECTION : DIRECTION + 3] = normalize(np.array(self.direction))
        angle = radians(self.half_angle)
        row[COS_HALF_ANGLE], row[HALF_ANGLE] = max(0.0, cos(angle)), angle
        row[EXPONENT] = self.exponent


class DirectionalLight(_Directed):
    """Infinitely distant: `direction` is the way its light travels; no attenuation.

    `angle`: the diameter of the disc that casts the shadows, in degrees as seen from here; 0 casts hard ones.
    """

    light: Literal["directional"] = "directional"
    kind: ClassVar[int] = DIRECTIONAL
    direction: Direction
    angle: Diameter = 0.0

    def _write(self, row: Float64s) -> None:
        super()._write(row)
        row[RADIUS] = tan(radians(self.angle / 2))
        row[DIRECTION : DIRECTION + 3] = normalize(np.array(self.direction))


class AmbientLight(LightSource):
    """I_a: the same from everywhere, reflected as k_a I_a."""

    light: Literal["ambient"] = "ambient"
    kind: ClassVar[int] = AMBIENT


def _path(value: Any) -> Any:
    """Check that a value can be the path of an image."""
    if not isinstance(value, str | Path) or not str(value):
        raise ValueError("the path of an image")
    return Path(value)


ImagePath = Annotated[Path, _path]


class SkyLight(BaseLight):
    """A gradient from `horizon` to `zenith`, linear in the sine of the elevation, over one colour of the `ground`.

    `up`: towards the zenith. All three times `intensity`; where they are equal it is `AmbientLight`, exactly.
    """

    light: Literal["sky"] = "sky"
    zenith: Radiance
    horizon: Radiance
    ground: Radiance = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 0.0, 1.0)

    def row(self) -> Float64s:
        """The packed sky that `raytrace.lights.environment` reads."""
        colours = [np.multiply(self.intensity, colour) for colour in (self.zenith, self.horizon, self.ground)]
        return np.concatenate([*colours, normalize(np.array(self.up))])


class EnvironmentLight(BaseLight):
    """A latitude–longitude `image`, 360° by 180°: any that can be read, 8 and 16 bits as sRGB, floats as they are.

    Its upper edge is `up`. Its centre is in the direction of +y (of −z, if y is up), turned by `turn` degrees
    counter-clockwise seen from above. It is kept as 128 by 64 texels: its light, not its picture.
    """

    light: Literal["environment"] = "environment"
    image: ImagePath
    up: Direction = (0.0, 0.0, 1.0)
    turn: float = 0.0

    def frame(self) -> Float64s:
        """Rows right, front and up (3, 3), unit."""
        up = normalize(np.array(self.up))
        ahead = np.array([0.0, 1.0, 0.0])
        ahead = np.array([0.0, 0.0, -np.sign(up[1])]) if abs(up[1]) > 0.999 else ahead
        front = normalize(ahead - (ahead @ up) * up)
        right = np.cross(front, up)
        sine = np.sin(np.radians(self.turn))
        cosine = np.cos(np.radians(self.turn))
        return np.stack([cosine * right + sine * front, cosine * front - sine * right, up])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as of other lights, with the image's path as text."""
        return super().to_dict() | {"image": str(self.image)}


Light = PointLight | DirectionalLight | SpotLight | AmbientLight | SkyLight | EnvironmentLight


def light_from_dict(data: dict[str, Any]) -> BaseLight:
    """A light from plain values: `light` ("point", "directional", "spot", "ambient", "sky", "environment"), its fields.

    Raises: OptionError naming the light, the field, what is accepted and what came.
    """
    light: BaseLight = made_of(data, get_args(Light), "light", "light")
    return light


def pack_lights(lights: Sequence[LightSource]) -> tuple[Int64s, Float64s]:
    """Kinds (k,) int64 and rows (k, WIDTH) float64 of lights, and behind them of what these add to ambient light."""
    ambient = [AmbientLight(intensity=directed.ambient) for directed in lights if isinstance(directed, _Directed)]
    packed = [light.pack() for light in (*lights, *(directed for directed in ambient if any(directed.intensity)))]
    light_rows = np.array([row for _, row in packed], np.float64).reshape(-1, WIDTH)
    return np.array([kind for kind, _ in packed], np.int64), light_rows


def irradiance(
    intensity: npt.ArrayLike, n: npt.ArrayLike, l: npt.ArrayLike, distance: npt.ArrayLike
) -> npt.NDArray[Any]:
    """E = I ⟨n·l⟩/d² (12.8), W/m².

    Args: intensity I in W/sr, of any shape (…,); vectors n and l (…, 3), which are normalised here, zero receives
    nothing; distance d > 0 in metres (…,).

    Raises: OptionError: n or l is not of finite numbers (…, 3).
    """
    units = []
    for name, vector in (("n", n), ("l", l)):
        values = numbers(vector, "irradiance", name, "an array of numbers (…, 3)")
        if values.shape[-1:] != (3,) or not np.isfinite(values).all():
            raise OptionError(name, "finite numbers (…, 3)", f"{values.tolist()}"[:60], "irradiance")
        units.append(normalize(values))
    cosine = np.maximum(0.0, np.sum(units[0] * units[1], axis=-1))
    return np.asarray(np.multiply(intensity, cosine) / np.square(distance))
