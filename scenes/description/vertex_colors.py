"""Colours of an OBJ's or PLY's vertices, for pictures: `v x y z r g b`, `red green blue`.

Neither format says how they are encoded. They are taken as sRGB, as most programs write and show them. The grey that a
bake has given a PLY shows w, and is no colour.
"""

from pathlib import Path

from raytrace.errors import printable
from raytrace.image.srgb import decode_srgb
from raytrace.types import Float64s

from ..formats.load import read_objects

_BEGIN = 1 << 16  # bytes of a file that show whether it can have any


def vertex_colors(path: Path) -> tuple[Float64s | None, list[str]]:
    """Linear RGB (n, 3) of the vertices in the file's order, None if they have none, and warnings.

    Raises: MeshError: as `scenes.load`.
    """
    if not _may_have_colors(path):
        return None, []
    (instance, *_), _ = read_objects(path, keep=True)
    notes = [printable(f"{path}: left out: {words}") for words in instance.unread if words.startswith("colours")]
    colors = instance.detail.colors if instance.detail else None
    return None if colors is None else decode_srgb(colors[:, :3].clip(0, 1)).astype(float), notes


def _may_have_colors(path: Path) -> bool:
    """Whether the first vertex of an OBJ has six numbers, or a PLY's header a property `red`."""
    with path.open("rb") as file:
        if path.suffix.lower() == ".ply":
            return b" red\n" in file.read(_BEGIN).partition(b"end_header")[0].replace(b"\r", b"")
        if path.suffix.lower() == ".obj":
            first = next((line for line in file if line.startswith((b"v ", b"v\t"))), b"")
            return len(first.partition(b"#")[0].split()) >= 7
    return False
