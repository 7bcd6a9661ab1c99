"""`obscurance view`: a page of baked files; a mesh in which no bake has left w is baked first, for a look."""

import webbrowser
from pathlib import Path
from shlex import quote

import numpy as np

from obscurance.raytrace.errors import OptionError, SceneError, printable
from obscurance.raytrace.image.texture import Texture, texture_codes
from obscurance.raytrace.mesh.mesh import TO_Y_UP, Mesh, up_axis
from obscurance.raytrace.mesh.warnings import lying_notes
from obscurance.raytrace.system.atomic import write_bytes
from obscurance.raytrace.system.checks import check_ending, check_outputs
from obscurance.raytrace.types import Float64s, UInt8s

from ..asset.asset import Asset
from ..asset.primitive import StoredBake
from ..bake.console import note
from ..bake.options import BakeOptions
from ..formats.load import load, parser_errors
from ..formats.stored_w import ENDINGS, find_profile, occlusion_textures, read_beside_w, read_w, unrepeated
from ..formats.table import endings, format_of
from ..show.page.base_colour import base_colour
from ..show.page.document import html_of_bakes
from ..show.page.encode import TexturedW, Values
from .bake import run_bake

_TOLERANCE = 0.02  # of w that is only looked at
_ARRAYS = (".npy", ".npz", *endings("raster"))  # values alone, without the mesh
_PAGE = "page.html"
_MOVED = 1e-4  # of the radius, by which formats may round coordinates


def run_view(
    result: Path, other: Path | None, output: Path | None, mesh: Path | None, up: str | None, open: bool, quiet: bool
) -> None:
    """Write the page, print a line, and open it in the browser if it is to `open`. Args: as of `view_results`."""
    if other is None and mesh is None and _is_unbaked(result):
        target = output or result.with_suffix(".html")
        check_ending("output", target, ".html")
        run_bake(BakeOptions(mesh=[result], output=target, tolerance=_TOLERANCE, up=up, quiet=quiet))
        if not quiet:
            note(f"{result}: there is no w in it; it was baked with --tolerance {_TOLERANCE:g}, for a look")
    else:
        target, summary = view_results(result, other, output, mesh, up)
        if not quiet:
            print(summary)
    if open:
        webbrowser.open(target.resolve().as_uri())


def _is_unbaked(path: Path) -> bool:
    """Whether a file is a mesh without w, or may be."""
    if not format_of(path).read:
        return False
    if path.suffix.lower() not in ENDINGS:
        return path.is_file()
    try:
        read_w(path)
    except SceneError as fault:
        return fault.field == "w" and fault.got == "none"
    return False


def view_results(
    result: Path, other: Path | None, output: Path | None, mesh: Path | None, up: str | None
) -> tuple[Path, str]:
    """Write the page of one bake, or of two with a slider between, and return its path and a line.

    Args: mesh: of `.npy`, `.npz`, `.tif`.
    """
    # What is shown, and where it is written.
    results = [result] if other is None else [result, other]
    for field, path in zip(("result", "other"), results, strict=False):
        if path.suffix.lower() not in ENDINGS:
            raise OptionError(field, "a baked file, its name ending in " + ", ".join(ENDINGS), path)
    if mesh is None and all(path.suffix.lower() in _ARRAYS for path in results):
        raise OptionError("mesh", f"--mesh with the mesh that {result.name} belongs to", "none")
    name = "-".join(path.stem for path in results) + ".html"
    target = result.with_name(name) if output is None else output
    check_ending("output", target, ".html")
    check_outputs({"--output": target}, [*results, *([mesh] if mesh else [])])
    # The mesh that both results are of, the smaller file's, and their values at its vertices.
    sources = {path: load(path, _PAGE) for path in results if path.suffix.lower() not in _ARRAYS}
    shared_file = load(mesh, _PAGE) if mesh else min(sources.values(), key=lambda file: len(file.mesh.vertices))
    read = [*shared_file.files, *results]
    for source in sources.values():
        _check_same(shared_file.mesh, source)
        read += source.files
    bakes = [_values(path, len(shared_file.mesh.vertices), sources.get(path)) for path in results]
    check_outputs({"--output": target}, read)
    # The page.
    title = " and ".join(path.name for path in results)
    page = html_of_bakes(shared_file.mesh, bakes, title, up, base_colour(shared_file))
    write_bytes(target, page)
    written = f"{target}: {len(shared_file.mesh.vertices):,} vertices, {len(page) / 1e6:.2f} MB; open it in a browser"
    return target, "\n".join(printable(line) for line in (written, *lying_notes(shared_file.mesh, up)))


def _values(path: Path, count: int, source: Asset | None) -> Values:
    """What a page shows of the first `count` vertices of a file.

    Args: source: the mesh file, None of values alone.
    """
    stored = source.baked if source else None
    textures = None
    if stored is None:
        profile = source.profile if source else find_profile(path)
        stored = StoredBake(read_w(path, count), profile=profile, **read_beside_w(path, count))
        textures = _textures(source)
    target = path.with_name(f"{path.stem}-falloff{'.glb' if path.suffix.lower() == '.gltf' else path.suffix}").name
    permanent = f"obscurance falloff {quote(path.name)} --half-distance {{}} -o {quote(target)}"
    return Values.of(stored.first(count), path.name, textures=textures, permanent=permanent).checked(count)


def _textures(source: Asset | None) -> TexturedW | None:
    """The occlusion textures by which w varies between vertices: all but ramps."""
    if source is None:
        return None
    with parser_errors(source.path):
        on_faces = occlusion_textures(source)
        if on_faces is None:
            return None
        mesh = source.mesh
        uv = np.zeros((len(mesh.vertices), 2))
        of = np.full(len(mesh.vertices), -1)
        shown = mesh.faces[on_faces.of >= 0]
        uv[shown] = on_faces.uv[on_faces.of >= 0] * (1, -1) + (0, 1)
        of[shown] = on_faces.of[on_faces.of >= 0, None]
        images = [_codes(*picture) for picture in on_faces.textures]
    return TexturedW(uv, of, images, [texture.wrap for texture, _ in on_faces.textures])


def _codes(texture: Texture, strength: float) -> UInt8s:
    """255 w, w being 1 + strength (R − 1); glTF's occlusion textures (section 5.21)."""
    codes = texture_codes(texture)
    most = {1: 255, 2: 65535}.get(codes.itemsize, 1)
    return np.rint(255 * np.clip(1 + strength * (codes[..., 0] / most - 1), 0, 1)).astype(np.uint8)


def _check_same(mesh: Mesh, source: Asset) -> None:
    """Check that a file has the vertices and faces of the mesh, but for vertices repeated with w of their own.

    Raises: SceneError.
    """
    other = source.mesh
    path = source.path
    count = len(mesh.vertices)
    stored_count = len(other.vertices) if source.w is None else unrepeated(other.vertices, (count,))
    if stored_count != count:
        raise SceneError(path, "vertices", f"the {count:,} of {mesh.source}", f"{len(other.vertices):,}")
    as_stored = np.abs(mesh.vertices - other.vertices[:count]).max()
    as_glb = np.abs(_upright(mesh, count) - _upright(other, count)).max()
    moved = min(float(as_stored), float(as_glb))
    if moved > _MOVED * mesh.radius:
        raise SceneError(path, "vertices", f"those of {mesh.source}", f"others, up to {moved:.3g} away")
    if not np.array_equal(other.vertices[other.faces], other.vertices[mesh.faces]):
        raise SceneError(path, "faces", f"those of {mesh.source}", "others")


def _upright(mesh: Mesh, count: int) -> Float64s:
    """The first `count` vertices with y up, as a `.glb` has them."""
    return np.asarray(mesh.vertices[:count] @ np.transpose(TO_Y_UP[up_axis(mesh)]))
