"""`bake --preset`: options that suit a program, as docs/programs.md explains them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raytrace.errors import ConflictError

PRESETS: dict[str, dict[str, Any]] = {
    "unreal": {"format": "glb", "occlusion": "texture", "bits": "8", "bent_space": "tangent-directx"},
    "unity": {"format": "png", "occlusion": "texture", "bits": "8", "bent_space": "tangent"},
    "godot": {"format": "glb", "occlusion": "texture", "bits": "8", "bent_space": "tangent"},
    "blender": {"format": "glb", "colors": "rgb", "bits": "16", "bent_space": "tangent"},
    "three": {"format": "glb", "occlusion": "ramp", "bits": "8", "bent_space": "tangent"},
}
"""Values of options by program; `with_preset` says where each applies."""
_READS = {
    "unreal": (".glb", ".png", ".exr", ".tif"),
    "unity": (".glb", ".png", ".exr", ".tif"),
    "godot": (".glb", ".png", ".exr"),
    "blender": (".glb", ".ply", ".png", ".exr", ".tif"),
    "three": (".glb", ".ply", ".png", ".exr"),
}


def with_preset(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a bake to one output, and what their preset sets of those that are not given."""
    preset, ending = options["preset"], options["output"].suffix.lower()
    if preset is None:
        return {**options}
    if ending not in _READS[preset]:
        raise ConflictError(("preset", preset), "needs", "an output that ends in " + " ".join(_READS[preset]))
    images = [path for path in (options["output"], options["bent_normals"]) if path]
    applies = {
        "colors": ending in (".glb", ".ply") and options["occlusion"] is None,
        "occlusion": ending == ".glb" and not options["colors"],
        "bits": any(Path(path).suffix.lower() == ".png" for path in images),
        "bent_space": options["bent_normals"] is not None,
    }
    chosen = {name: value for name, value in PRESETS[preset].items() if applies.get(name) and not options[name]}
    return {**options, **chosen}


def preset_format(options: Mapping[str, Any]) -> str | None:
    """The format of outputs whose names do not tell it: as given, or of the preset."""
    return options["format"] or PRESETS.get(options["preset"], {}).get("format")


def without_preset(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of an earlier bake less what its preset had set, which another preset or output may set otherwise."""
    chosen = PRESETS.get(str(options.get("preset")), {})
    return {name: value for name, value in options.items() if chosen.get(name) != value}


def _described(values: Mapping[str, Any]) -> str:
    given = {name.replace("_", "-"): "" if value is True else f" {value}" for name, value in values.items()}
    return " ".join(f"--{name}{value}" for name, value in given.items())


HELP = "Options for a program where they apply and are not given: " + "; ".join(
    f"{program}: {_described(values)}" for program, values in PRESETS.items()
)  # fmt: skip
