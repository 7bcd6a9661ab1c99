"""Light from all around that is not the same from everywhere: sky gradients, and images.

    SkyLight(zenith=(0.2, 0.4, 0.9), horizon=(0.8, 0.8, 0.8), ground=0.2)
    EnvironmentLight(image="studio.exr", intensity=0.5)

A surface reflects of them as of ambient light, k_a I_a w, with I_a the cosine-weighted mean over the hemisphere about
its bent normal, or its normal; the part that a glossy material mirrors comes from the mirror direction.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from ..errors import OptionError
from ..mesh.normals import normalize
from ..system.parameters import Direction, Finite, Radiance
from ..types import Float32s, Float64s
from . import layout
from .sources import BaseLight


def _path(value: Any) -> Any:
    if not isinstance(value, str | Path) or not str(value):
        raise ValueError("the path of an image")
    return Path(value)


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
        """The row that `raytrace.lights.environment_kernels` reads."""
        colours = [np.multiply(self.intensity, colour) for colour in (self.zenith, self.horizon, self.ground)]
        return np.concatenate([*colours, normalize(np.array(self.up))])


class EnvironmentLight(BaseLight):
    """A latitude–longitude `image`, 360° by 180°: any that can be read, 8 and 16 bits as sRGB, floats as they are.

    Its upper edge is `up`. Its centre is in the direction of +y (of −z, if y is up), turned by `turn` degrees
    counter-clockwise seen from above. It is kept as 128 by 64 texels: its light, not its picture.
    """

    light: Literal["environment"] = "environment"
    image: Annotated[Path, BeforeValidator(_path)]
    up: Direction = (0.0, 0.0, 1.0)
    turn: Finite = 0.0

    def frame(self) -> Float64s:
        """Rows right, front and up (3, 3), unit."""
        up = normalize(np.array(self.up))
        ahead = np.array([0.0, 1.0, 0.0])
        ahead = np.array([0.0, 0.0, -np.sign(up[1])]) if abs(up[1]) > 0.999 else ahead
        front = normalize(ahead - (ahead @ up) * up)
        right = np.cross(front, up)
        sine, cosine = np.sin(np.radians(self.turn)), np.cos(np.radians(self.turn))
        return np.stack([cosine * right + sine * front, cosine * front - sine * right, up])

    def to_dict(self) -> dict[str, Any]:
        """As for other lights, the path as text."""
        return super().to_dict() | {"image": str(self.image)}


class Environment(NamedTuple):
    """Light from all around as kernels read it.

    Attributes:
        skies: float64 (k, SKY_WIDTH), sky gradients. harmonics: float64 (9, 3) of an image, or (0, 3). maps: float32
        (MAPS, MAP_HEIGHT, MAP_WIDTH, 3), or none. frame: float64 (3, 3), rows right, front and up of the maps.
    """

    skies: Float64s
    harmonics: Float64s
    maps: Float32s
    frame: Float64s


def pack_environment(lights: Iterable[BaseLight]) -> Environment:
    """The sky gradients and the image among `lights`.

    Raises:
        InputError: the image cannot be read.
        OptionError: there are two images.
    """
    lights = list(lights)
    skies = np.array([light.row() for light in lights if isinstance(light, SkyLight)]).reshape(-1, layout.SKY_WIDTH)
    images = [light for light in lights if isinstance(light, EnvironmentLight)]
    if not images:
        none = np.empty((0, layout.MAP_HEIGHT, layout.MAP_WIDTH, 3), np.float32)
        return Environment(skies, np.empty((0, 3)), none, np.eye(3))
    if len(images) > 1:
        raise OptionError("lights", "one environment image at most", f"{len(images)}", "scene")
    from .prefilter import blurred_maps, irradiance_harmonics, read_environment

    frame = images[0].frame()
    image = read_environment(images[0].image) * np.array(images[0].intensity)
    return Environment(skies, irradiance_harmonics(image, frame), blurred_maps(image), frame)
