"""`obscurance merge`: the parts of a bake to its output."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ..commands.console import note
from ..textures.command import bake_command
from ..writers.image_names import is_texture
from .part import is_texture_part


def merge(folder: Path, options: dict[str, Any]) -> None:
    """Make of the parts in `folder` what the bake would have made.

    Args: options: of the output, as `bake` has them; `mesh` and `high`: where they are now, None where they were.

    Raises:
        InputError: a part is missing, not finished or of another bake, or an option.
        OutputError, MemoryLimitError: as `bake`.
    """
    from ao.trace.merge import Merge, read_parts
    from raytrace.errors import OptionError

    parts = read_parts(folder)
    description, output = parts[0].description, options["output"]
    texture = is_texture_part(description)
    if texture and output.suffix.lower() == ".glb":
        options["occlusion"] = "texture"
    elif texture != is_texture(output):
        expected = (
            "an image or a .glb: the parts are of a texture" if texture else "a file of vertices, as the parts are"
        )
        raise OptionError("output", expected, output)
    for name in ("mesh", "high"):
        stored = description.get(name)
        options[name] = options[name] or (Path(stored) if stored else None)
    command = bake_command({**description["options"], **options, "resume": False})
    replace(command, open_checkpoint=lambda _: Merge(parts, note)).run()
