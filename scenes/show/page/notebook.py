"""A bake's page within a notebook: what `_repr_html_` of `ao.Bake` shows, by an entry point."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING

from .document import html_of_bakes
from .encode import Values

if TYPE_CHECKING:
    from obscurance.ao import Bake

_MOST = 250_000  # vertices; a notebook keeps some 10 bytes of each


def framed_page(bake: Bake) -> str | None:
    """The page in an `iframe`, or None of a mesh too large to be kept in a notebook, which then shows a picture."""
    if len(bake.mesh.vertices) > _MOST:
        return None
    name = Path(bake.mesh.source).name
    values = Values(bake.w, bake.error, bake.flags, bake.bent_normals, name, profile=bake.profile)
    content = html.escape(html_of_bakes(bake.mesh, [values], name).decode())
    return f'<iframe srcdoc="{content}" width="100%" height="480" style="border: 0"></iframe>'
