"""The built-in scenes: each a TOML text that stands alone and is meant to be edited."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import NamedTuple

from raytrace.atomic import atomic_write
from raytrace.errors import OptionError, nearest_name
from raytrace.outputs import check_ending, check_outputs

from .library.cornell import cornell
from .library.materials import materials
from .library.plane_wall import plane_wall
from .library.sponge import sponge
from .library.still_life import still_life
from .library.temple import temple


class Builtin(NamedTuple):
    """A scene in one sentence, and the function that makes its TOML."""

    summary: str
    toml: Callable[[], str]


BUILTIN: dict[str, Builtin] = {
    "plane_wall": Builtin("an open plane with a wall and its shadow", plane_wall),
    "cornell": Builtin("a closed room with coloured walls, lamp and camera inside", cornell),
    "temple": Builtin("a colonnade in the evening sun", temple),
    "sponge": Builtin("a Menger sponge, nearly all ambient light", sponge),
    "materials": Builtin("a grid of spheres, one of every material", materials),
    "still_life": Builtin("fruit, a cup and books under a spot light", still_life),
}


def builtin_toml(name: str) -> str:
    """A built-in scene as TOML, which `scenes.read.read_scene` reads. Raises: OptionError: no such scene."""
    if name not in BUILTIN:
        raise OptionError("name", "one of " + ", ".join(BUILTIN), name, nearest=nearest_name(name, BUILTIN))
    return BUILTIN[name].toml()


def write_builtin(name: str, path: str | os.PathLike[str]) -> None:
    """Write a built-in scene's TOML to `path`, whole or not at all.

    Raises:
        OptionError: no such scene, a name that does not end in .toml, or an existing file that is no scene.
        OutputError: the file cannot be written.
    """
    content = builtin_toml(name)
    check_ending("--output", path, ".toml")
    check_outputs({"--output": path})
    with atomic_write(path) as file:
        file.write(content.encode())
