"""A bake as a file, in the format of its ending."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np

from obscurance.raytrace.errors import ConflictError, OptionError, Term
from obscurance.raytrace.system.atomic import PathName, check_writable, write_bytes

from ..asset.asset import Asset
from ..asset.primitive import known_columns
from .load import load
from .table import Channels, endings, format_of

if TYPE_CHECKING:
    from obscurance.ao import Bake, BakedTexture

Occlusion = Literal["none", "ramp"]
_PLY_NAME = r"(?!(n?[xyz]|[stuv]|red|green|blue|alpha|texture_.|obscurance\w*)$)[A-Za-z_]\w*"
Colors = Literal["rgb", "r", "g", "b", "a"]


def check_target(path: PathName) -> None:
    """Find out before the bake whether `write` will accept `path`. Raises: OptionError: of its ending; OutputError."""
    _writer(path)
    check_writable(path)


def check_holds(path: PathName, at: str, both_sides: bool) -> None:
    """Check that the format holds w of what is baked: of faces, of points alone, of both sides.

    Raises: ConflictError.
    """
    if "faces" not in format_of(path).holds and (at != "vertices" or both_sides):
        terms: dict[str, Term] = {"faces": ("at", "faces"), "points": "points"}
        term = terms.get(at, "both_sides")
        raise ConflictError(term, "needs", "an output that ends in " + " ".join(endings("faces")))


def write(
    path: str | os.PathLike[str],
    bake: Bake | BakedTexture | Sequence[Bake | BakedTexture] | Asset,
    mesh_file: Asset | str | os.PathLike[str] | Any = None,
    *,
    colors: Colors | None = None,
    occlusion: Occlusion | None = None,
    replace_occlusion: bool = False,
    up: str | None = None,
    ply_name: str | None = None,
) -> None:
    """Write a bake in the format of the ending, whole or not at all; the same input gives the same bytes.

    - `.npy`: w, float32 (n,), or (n, 2) with that of the backs.
    - `.npz`: `w` float32 (n,), `error` float32 (n,), `bent_normals` float32 (n, 3), `flags` uint8 (n,), as far as they
      are known; of a profile `profile` float32 (n, k), `half_distances` float64 (k,), `radius`, and `max_distance` if
      it has a limit.
    - `.ply`: `obscurance`, error, flags and bent normals behind the same word, and w as the grey `red green blue`,
      sRGB-encoded as Blender and three.js take the colours of a PLY (`scenes.formats.ply.write.ply`). Coordinates are
      float where that loses nothing, double otherwise.
    - `.glb`: attributes of the same names in capitals (`scenes.formats.gltf.write.glb`), and what viewers show: a ramp
      or colours.
    - `.obj`: w as the grey `v x y z r g b`, sRGB-encoded (`scenes.formats.obj.write`).
    - `.vtp`: `obscurance`, and `error`, `flags`, `bent_normals` as far as they are known (`scenes.formats.vtp`).
    - `.html`: a page for a browser, everything in it (`scenes.show.page.document`).
    - `.png` `.exr` `.tif`, of a texture: w, linear, PNG of 16 bits, else float32.

    Of textures a `.glb` has each as the occlusion texture of the faces that it is for (`scenes.formats.gltf.textured`).

    What the source holds besides is kept as far as the format can hold it; `scenes.formats.unsupported` lists what is
    not.

    Args:
        path: the target, replaced if it exists.
        bake: per vertex of `mesh_file.mesh`, for a .glb or .html also of `mesh_file.split`; or a texture of its faces.
            Or a mesh file, whose own w is written.
            For a .glb also a list of textures of different faces; a bake per vertex among them is for faces on none.
        mesh_file: what was baked, with what else it holds: of `load`, or the file's path; or a mesh in any form that
            `ao.bake` takes; None: the mesh of the bake alone.
        colors: "rgb": give a .glb the vertex colours `COLOR_0` = w, and a .ply the grey, in place of the
            source's colours; "r", "g", "b" or "a": w in that channel alone, the others as in the source, 1 without.
        occlusion: "ramp" gives a .glb's materials an occlusion texture that shows w, "none" does not; None is "ramp",
            but "none" with `colors`.
        replace_occlusion: put the ramp also in place of occlusion textures of the source.
        up: "x", "y", "z", "-x", "-y" or "-z", the axis that is up, in place of `Mesh.up`: a page stands so, a .ply says
            so in its header (`comment up z`), and what was no glTF is turned by a root node of a .glb, where y is up;
            vertices stay what they are.
        ply_name: of a further property of a .ply that holds w, such as "quality", which MeshLab shows.

    Raises:
        OptionError: unknown ending, options that exclude each other, coordinates that a .glb cannot hold, or a bake
            of another mesh.
        MeshError: materials of a glTF source are malformed.
        OutputError: the file cannot be written; an existing one is untouched.
    """
    if isinstance(bake, Asset):
        baked, mesh_file = bake.baked, mesh_file or bake
        if baked is None:
            raise OptionError("bake", f"w in {bake.path}, or a bake", "none")
        bake = cast("Bake", baked)
    several = bake if isinstance(bake, Sequence) else [bake]
    source = getattr(several[0], "mesh", None) if mesh_file is None else mesh_file
    if isinstance(source, str | os.PathLike):
        source = load(source, path)
    elif not isinstance(source, Asset):
        source = Asset.of(source)
    if isinstance(bake, Sequence) or bake.w.ndim == 2:  # texels, not vertices
        for name, value in {"colors": colors, "occlusion": occlusion, "up": up}.items():
            if value:
                raise ConflictError(name, "does not go with", "a texture")
        _write_textures(Path(path), several, source, replace_occlusion)
        return
    values = cast("Bake", bake)
    check_holds(path, values.at, values.below is not None)
    if values.at == "vertices" and Path(path).suffix.lower() in (".glb", ".html"):
        source.baked_mesh(len(bake.w))
    else:
        count = len(source.cloud[0] if source.cloud else getattr(source.mesh, values.at))
        if len(bake.w) != count:
            raise OptionError("bake", f"w of the {count:,} {values.at} of {source.path}", f"{len(bake.w):,}")
    where = channels(path, colors, occlusion, replace_occlusion, up, ply_name)
    write_vertices(path, values, source, where)


def write_vertices(path: PathName, bake: Bake, mesh_file: Asset, shown: Channels) -> None:
    """Write a bake per vertex. Args: shown: the channels that viewers look at. Raises: as `write`."""
    write_bytes(path, _writer(path)(bake, mesh_file, shown))


def _write_textures(path: Path, baked: Sequence[Bake | BakedTexture], mesh_file: Asset, replace: bool) -> None:
    """Write baked textures, with w of vertices where there is some too. Raises: as `write`."""
    from obscurance.ao.texture.result import BakedTexture

    from .gltf.textured import textured_glb
    from .images import is_texture, write_grey

    textures = [bake for bake in baked if isinstance(bake, BakedTexture)]
    vertices = [bake.w for bake in baked if not isinstance(bake, BakedTexture)]
    for texture in textures:
        if len(texture.uv) != len(mesh_file.mesh.faces):
            expected = f"a texture of the {len(mesh_file.mesh.faces):,} faces of {mesh_file.path}"
            raise OptionError("bake", expected, f"{len(texture.uv):,} faces")
    if path.suffix.lower() == ".glb":
        write_bytes(path, textured_glb(mesh_file, textures, replace, w=vertices[0] if vertices else None)[0])
    elif is_texture(path) and len(baked) == 1:
        write_grey(path, textures[0].w, False, {"content": "w, 1 = open"}, profile=textures[0].profile)
    else:
        raise OptionError("output", "a .glb, or an image of one texture", os.fspath(path))


def channels(
    path: PathName,
    colors: Colors | None,
    occlusion: Occlusion | None,
    replace_occlusion: bool,
    up: str | None = None,
    ply_name: str | None = None,
) -> Channels:
    """The channels of w for viewers. Raises: OptionError: options that exclude each other, or the ending."""
    ending = Path(path).suffix.lower()
    for name, value, kind in (("colors", colors, Colors), ("occlusion", occlusion, Occlusion)):
        if value and value not in get_args(kind):
            raise OptionError(name, "one of " + ", ".join(get_args(kind)), value)
    if colors and "colors" not in format_of(path).holds:
        raise ConflictError("colors", "needs", "a .glb or .ply output")
    if occlusion == "ramp" and ending != ".glb":
        raise ConflictError(("occlusion", "ramp"), "needs", "a .glb output")
    if occlusion == "ramp" and colors:
        raise ConflictError("colors", "does not go with", ("occlusion", "ramp"))
    ramp = ending == ".glb" and (occlusion == "ramp" if occlusion else not colors)
    if replace_occlusion and not ramp:
        raise ConflictError("replace_occlusion", "needs", "an occlusion texture to write")
    if ply_name and ending != ".ply":
        raise ConflictError("ply_name", "needs", "a .ply output")
    if ply_name and not re.fullmatch(_PLY_NAME, ply_name):
        raise OptionError("ply_name", "a word other than those of coordinates and colours, such as quality", ply_name)
    return Channels(colors or "", ramp, replace_occlusion, up, ply_name)


ENDINGS = tuple(ending for ending in endings("write") if ending not in endings("raster"))  # for any mesh


def _writer(path: PathName) -> Callable[..., bytes | memoryview]:
    """The function that writes files with this ending. Raises: OptionError: none does."""
    target = format_of(os.fspath(path)).write
    if not target:
        raise OptionError("output", "a name ending in " + ", ".join(ENDINGS), os.fspath(path))
    writer: Callable[..., bytes | memoryview] = resolve_name(target)
    return writer


def npy(bake: Bake, *_: object) -> memoryview:
    """A `.npy` file of w, of both sides where the bake has both."""
    content = io.BytesIO()
    w = np.stack([bake.w, bake.below.w], axis=-1) if bake.below else bake.w
    np.save(content, w.astype("<f4"), allow_pickle=False)
    return content.getbuffer()


def npz(bake: Bake, _: object = None, channels: Channels = Channels()) -> memoryview:
    """w, error and bent normals as float32, flags as uint8, as far as they are known; the profile as it is kept."""
    content = io.BytesIO()
    arrays: dict[str, Any] = known_columns(bake)
    if bake.below:
        arrays |= {f"{name}_below": values for name, values in known_columns(bake.below).items()}
    if profile := bake.profile:
        arrays |= {"profile": profile.values} | {name: np.float64(value) for name, value in profile.lengths.items()}
    if channels.record:
        arrays["bake"] = np.array(channels.record)
    np.savez(content, **arrays)
    return content.getbuffer()


FORMATS = (
    {"ending": ".npy", "name": "NumPy", "write": "obscurance.scenes.formats.write:npy", "holds": ("w", "faces")},
    {
        "ending": ".npz",
        "name": "NumPy",
        "write": "obscurance.scenes.formats.write:npz",
        "holds": ("w", "profile", "faces"),
    },
    {
        "ending": ".html",
        "name": "HTML",
        "write": "obscurance.scenes.show.page.document:page_of_bake",
        "holds": ("profile",),
    },
)
