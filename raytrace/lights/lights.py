"""All kinds of light, and a light from the plain values of a scene file."""

from typing import Any, get_args

from ..system.parameters import made_of
from .environment import EnvironmentLight, SkyLight
from .sources import AmbientLight, BaseLight, DirectionalLight, PointLight, SpotLight

Light = PointLight | DirectionalLight | SpotLight | AmbientLight | SkyLight | EnvironmentLight


def light_from_dict(data: dict[str, Any]) -> BaseLight:
    """A light from plain values: `light` ("point", "directional", "spot", "ambient", "sky", "environment"), its fields.

    Raises: OptionError naming the light, the field, what is accepted and what came.
    """
    return made_of(data, get_args(Light), "light", "light")
