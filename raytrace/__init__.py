"""Ray casting on Embree and local illumination; knows nothing of baking, scene files or the command line.

Names are imported when they are first used, so that `import raytrace` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import EmbreeError, InputError, MemoryLimitError, MeshError, ObscuranceError, OptionError, OutputError
from .mesh import Mesh

if TYPE_CHECKING:
    from .camera import Camera
    from .frame import Frame
    from .lights import AmbientLight, DirectionalLight, Light, PointLight, SpotLight, irradiance, light_from_dict
    from .materials import (
        BlinnPhong,
        CookTorrance,
        EllipticalBeckmann,
        Lambert,
        Material,
        OrenNayar,
        Phong,
        PoulinFournier,
        Strauss,
        material_from_dict,
    )
    from .normals import face_normals, vertex_normals
    from .polygon_normals import (
        averaged_normal,
        corner_normals,
        implicit_normals,
        newell_normal,
        newell_sums,
        parametric_normals,
    )
    from .presets import PRESETS
    from .reflection import reflect
    from .rendering import render
    from .scene import Object, Scene, Shape
    from .settings import Settings
    from .texture import Texture

_HOMES = {
    "camera": ("Camera",),
    "frame": ("Frame",),
    "lights": (
        "AmbientLight",
        "DirectionalLight",
        "Light",
        "PointLight",
        "SpotLight",
        "irradiance",
        "light_from_dict",
    ),
    "materials": (
        "BlinnPhong",
        "CookTorrance",
        "EllipticalBeckmann",
        "Lambert",
        "Material",
        "OrenNayar",
        "Phong",
        "PoulinFournier",
        "Strauss",
        "material_from_dict",
    ),
    "normals": ("face_normals", "vertex_normals"),
    "polygon_normals": (
        "averaged_normal",
        "corner_normals",
        "implicit_normals",
        "newell_normal",
        "newell_sums",
        "parametric_normals",
    ),
    "presets": ("PRESETS",),
    "reflection": ("reflect",),
    "rendering": ("render",),
    "scene": ("Object", "Scene", "Shape"),
    "settings": ("Settings",),
    "texture": ("Texture",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "PRESETS",
    "AmbientLight",
    "BlinnPhong",
    "Camera",
    "CookTorrance",
    "DirectionalLight",
    "EllipticalBeckmann",
    "EmbreeError",
    "Frame",
    "InputError",
    "Lambert",
    "Light",
    "Material",
    "MemoryLimitError",
    "Mesh",
    "MeshError",
    "Object",
    "ObscuranceError",
    "OptionError",
    "OrenNayar",
    "OutputError",
    "Phong",
    "PointLight",
    "PoulinFournier",
    "Scene",
    "Settings",
    "Shape",
    "SpotLight",
    "Strauss",
    "Texture",
    "averaged_normal",
    "corner_normals",
    "face_normals",
    "implicit_normals",
    "irradiance",
    "light_from_dict",
    "material_from_dict",
    "newell_normal",
    "newell_sums",
    "parametric_normals",
    "reflect",
    "render",
    "vertex_normals",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'raytrace' has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)
