"""A page to look at a bake just made, which says how to write it with another falloff."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...formats.load import PIPED, MeshFile
from ...formats.table import Channels
from .base_colour import base_colour
from .document import html_of_bakes
from .encode import Values

if TYPE_CHECKING:
    from obscurance.ao import Bake


def html(bake: Bake | Values, mesh_file: MeshFile, channels: Channels) -> bytes:
    """The page, everything in it."""
    name = mesh_file.path.name
    title = "standard input" if mesh_file.path.stem == PIPED else name
    values = Values(
        bake.w, bake.error, bake.flags, bake.bent_normals, title, profile=bake.profile, permanent=channels.again
    )
    return html_of_bakes(mesh_file.baked_mesh(len(bake.w)), [values], title, channels.up, base_colour(mesh_file))
