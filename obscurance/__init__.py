"""One face of the three packages `ao`, `raytrace` and `scenes`, whose names are imported when they are first used:

    import obscurance
    baked = obscurance.bake("duck.glb", max_distance="20%")
    obscurance.write("duck_ao.glb", baked, "duck.glb")

The command is `obscurance.cli`, by a name that is this project's own: `python -m obscurance`. Its file is `cli.py`
beside this folder in the source tree, and in the folder `command` of a wheel, lest another package's replace it.
"""

import os.path

_folder = os.path.dirname(__file__)
_in_wheel = os.path.join(_folder, "command")
__path__.append(_in_wheel if os.path.isdir(_in_wheel) else os.path.dirname(_folder))
_PACKAGES = {
    "Binary": "ao",
    "Camera": "raytrace",
    "Exponential": "ao",
    "Linear": "ao",
    "Smooth": "ao",
    "Tabulated": "ao",
    "bake": "scenes.commands.in_python",
    "bake_points": "ao",
    "bake_texture": "ao",
    "load": "scenes",
    "render": "scenes",
    "unwrap": "scenes",
    "view": "scenes",
    "write": "scenes",
}
__all__ = list(_PACKAGES)


def __getattr__(name: str) -> object:
    if name not in _PACKAGES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_PACKAGES[name]), name)


def __dir__() -> list[str]:
    return sorted(_PACKAGES)
