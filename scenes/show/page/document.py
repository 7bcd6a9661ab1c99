"""A page as one HTML file: style, scripts, shaders and data inside, and a policy that lets nothing else in."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy.typing as npt

from obscurance.raytrace import Mesh, OptionError
from obscurance.raytrace.errors import check_type, printable
from obscurance.raytrace.mesh.up import FROM, UP, up_axis
from obscurance.raytrace.types import AnyFloats

from ..look import FLAGS, LOOK
from .base_colour import BaseColour
from .encode import Values, encoded

_SCRIPTS = (
    *("colour", "data", "camera", "coarse", "target", "surface", "pick", "hover"),
    *("controls", "address", "panel", "distance", "page"),
)
_SHADERS = "surface.vert", "surface.frag", "dots.vert", "dots.frag"


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
    return html_of_bakes(mesh, [Values(w, error, flags, bent_normals, name)], name, up, base)


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
