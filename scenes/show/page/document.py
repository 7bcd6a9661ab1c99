"""A page as one HTML file: style, scripts, shaders and data inside, and a policy that lets nothing else in."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from obscurance.raytrace import Mesh, OptionError
from obscurance.raytrace.camera import FROM
from obscurance.raytrace.errors import check_type, printable
from obscurance.raytrace.mesh.mesh import UP, up_axis
from obscurance.raytrace.types import AnyFloats

from ...asset.asset import Asset
from ...formats.load import PIPED
from ...formats.table import Channels
from ..look import FLAGS, LOOK
from .base_colour import BaseColour, base_colour
from .encode import Values, encoded

if TYPE_CHECKING:
    from obscurance.ao import Bake

_SCRIPTS = (
    *("colour", "data", "camera", "coarse", "target", "surface", "pick", "hover"),
    *("controls", "address", "panel", "distance", "page"),
)
_SHADERS = "surface.vert", "surface.frag", "dots.vert", "dots.frag"
_MOST = 250_000  # vertices; a notebook keeps some 10 bytes of each


def html_page(
    mesh: Mesh,
    w: AnyFloats,
    error: AnyFloats | None = None,
    flags: npt.NDArray[Any] | None = None,
    bent_normals: AnyFloats | None = None,
    title: str | None = None,
    up: str | None = None,
    base: BaseColour | str | None = None,
) -> bytes:
    """A page that shows one bake in a browser, UTF-8: the same input gives the same bytes.

    Args:
        mesh: what was baked.
        w: (n,), in [0, 1], a vertex each.
        error: (n,), the standard error of w.
        flags: (n,), bits of `ao.Flag`.
        bent_normals: (n, 3).
        title: by default what the mesh is called.
        up: "x", "y", "z", "-x", "-y" or "-z", the axis that is upwards at first, in place of `mesh.up`.
        base: base colours (`scenes.show.page.base_colour.base_colour`), or why they cannot be shown.

    Raises: OptionError: values of a wrong shape or out of range, or another axis.
    """
    name = mesh.source if title is None else title
    return html_of_bakes(mesh, [Values(w, error, flags, bent_normals, name=name)], name, up, base)


def html_of_bakes(
    mesh: Mesh, bakes: Sequence[Values], title: str, up: str | None = None, base: BaseColour | str | None = None
) -> bytes:
    """A page that shows one bake of a mesh, or two with a slider between; the rest as `html_page`."""
    check_type(mesh, Mesh, "page", "mesh", "a raytrace.Mesh")
    if not 1 <= len(bakes) <= 2:
        raise OptionError("bakes", "one or two", len(bakes), "page")
    standing = {"up": up_axis(mesh, up), "ups": {name: [axis, FROM[axis]] for name, axis in UP.items()}}
    checked = [bake.checked(len(mesh.vertices)) for bake in bakes]
    facts, data = encoded(mesh, checked, None if isinstance(base, str) else base)
    facts["baseMissing"] = base if isinstance(base, str) else None
    facts |= {"title": printable(title), **standing, "look": LOOK, "flags": list(FLAGS.items())}
    style = _part("page.css")
    script = "\n".join(_part(f"{name}.js") for name in _SCRIPTS)
    shaders = "\n".join(f'<script type="x-shader" id="{name}">\n{_part(name)}</script>' for name in _SHADERS)
    holes = {
        "policy": policy(style, script),
        "title": html.escape(printable(title)),
        "style": style,
        "shaders": shaders,
        "facts": json.dumps(facts, allow_nan=False, ensure_ascii=True).replace("<", "\\u003c"),
        "data": base64.b64encode(data).decode(),
        "script": script,
    }
    return re.sub("@@(.*?)@@", lambda hole: holes[hole[1]], _part("page.html")).encode()


def policy(style: str, script: str = "") -> str:
    """A Content-Security-Policy: no network; inline this style and script, by their hashes, or pictures without one."""
    allowed = f"script-src '{_hashed(script)}'" if script else "img-src data:"
    return f"default-src 'none'; base-uri 'none'; form-action 'none'; style-src '{_hashed(style)}'; {allowed}"


def _hashed(text: str) -> str:
    """The hash of an inline style or script as a policy has it."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _part(name: str) -> str:
    return files(__package__).joinpath("parts", name).read_text("utf-8")


def page_of_bake(bake: Bake | Values, mesh_file: Asset, channels: Channels) -> bytes:
    """The page, everything in it."""
    name = mesh_file.path.name
    title = "standard input" if mesh_file.path.stem == PIPED else name
    values = Values(
        bake.w, bake.error, bake.flags, bake.bent_normals, bake.profile, name=title, permanent=channels.again,
        warning=channels.warning, rmse=bake.rmse,
    )  # fmt: skip
    return html_of_bakes(mesh_file.baked_mesh(len(bake.w)), [values], title, channels.up, base_colour(mesh_file))


def framed_page(bake: Bake) -> str | None:
    """The page in an `iframe`, or None of a mesh too large to be kept in a notebook, which then shows a picture."""
    if len(bake.mesh.vertices) > _MOST:
        return None
    name = Path(bake.mesh.source).name
    values = Values(bake.w, bake.error, bake.flags, bake.bent_normals, bake.profile, name=name, rmse=bake.rmse)
    content = html.escape(html_of_bakes(bake.mesh, [values], name).decode())
    return f'<iframe srcdoc="{content}" width="100%" height="480" style="border: 0"></iframe>'
