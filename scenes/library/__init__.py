"""The built-in scenes: each a self-contained TOML file, meant to be edited."""

from importlib import resources

from obscurance.raytrace.errors import OptionError, nearest_name
from obscurance.raytrace.system.atomic import PathName, write_bytes
from obscurance.raytrace.system.checks import check_ending, check_outputs

BUILTIN = {  # name to what one sees; the files are in library/
    "plane_wall": "an open plane with a wall and its shadow",
    "cornell": "a closed room with coloured walls, lamp and camera inside",
    "temple": "a colonnade in the evening sun",
    "sponge": "a Menger sponge, nearly all ambient light",
    "materials": "a grid of spheres, one of every material",
    "metals": "metals, plain and brushed, under a sky that they mirror",
    "still_life": "fruit, a cup and books under a spot light",
}


def builtin_toml(name: str) -> str:
    """A built-in scene as TOML, which `scenes.read_scene` reads. Raises: OptionError: no such scene."""
    if name not in BUILTIN:
        raise OptionError("name", "one of " + ", ".join(BUILTIN), name, nearest=nearest_name(name, BUILTIN))
    return (resources.files("obscurance.scenes") / "library" / f"{name}.toml").read_text(encoding="utf-8")


def write_builtin(name: str, path: PathName) -> None:
    """Write a built-in scene's TOML to `path`, whole or not at all.

    Raises:
        OptionError: no such scene, a name that does not end in .toml, or an existing file that is no scene.
        OutputError: the file cannot be written.
    """
    content = builtin_toml(name)
    check_ending("--output", path, ".toml")
    check_outputs({"--output": path})
    write_bytes(path, content.encode())
