"""Binary glTF of meshes that were no glTF: one node an object, one primitive a material of it.

Format: Khronos glTF 2.0 specification, section 3.9.2 (metallic-roughness), of materials with their images.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.image.colour import rgb_codes
from obscurance.raytrace.image.texture import Texture, texture_alpha, texture_codes
from obscurance.raytrace.image.write import linear_png
from obscurance.raytrace.mesh.corners import split_corners, split_creases
from obscurance.raytrace.mesh.mesh import Mesh, PerCorner
from obscurance.raytrace.mesh.normals import nonzero
from obscurance.raytrace.types import AnyInts, Float64s, Int64s

from ...asset.asset import Asset, Part
from ...asset.material import Material
from .accessors import flipped
from .builder import ELEMENT_ARRAY_BUFFER, GlbBuilder

_LARGEST = 1e38  # of float32, and of a difference of two
SOURCE_INDEX = "_SOURCE_INDEX"


class Drawn(NamedTuple):
    """A primitive of a document.

    Attributes: vertices: which of the mesh's vertices its own are. rows: of the mesh that is split at hard edges, or of
        a bake.
    """

    primitive: dict[str, Any]
    vertices: Int64s
    rows: AnyInts


def plain(asset: Asset, colors: str) -> tuple[GlbBuilder, list[Drawn]]:
    """The document, without w, and its primitives, in the order of `Asset.runs`, with `corner_normals`.

    The only primitive of a part has the part's vertices in their order, then those whose corners differ once more.
    One of several has the vertices that it uses, with their rows in the mesh as `_SOURCE_INDEX`.

    Args: colors: the channels that are to hold w: of all, the source's are left out.
    """
    mesh = asset.mesh
    builder = _empty_document()
    add_materials(builder, asset.materials)
    # What the document holds of each corner and vertex, and where its objects lie.
    runs = list(asset.runs())
    runs_of_part = Counter(run.part for run in runs)
    origins = [part_origin(mesh.vertices[part.vertices]) for part in asset.parts]
    uv = asset.per_corner("uv0")
    split = split_creases(mesh)
    rows_of = split.mesh.faces.ravel()
    split_by = [PerCorner(split.normals, rows_of), *([uv] if uv else [])]
    of_vertices = _vertex_columns(asset, colors)
    drawn: list[Drawn] = []
    before = None
    # A primitive for each run, in the node of its object.
    for run in runs:
        origin = origins[run.part]
        if run.object != before:
            before = run.object
            _add_node(builder, before.name, origin)
        part = asset.parts[run.part]
        vertices, faces, like = _run_vertices(mesh, part, run.faces, split_by, runs_of_part[run.part] == 1)
        attributes = {"POSITION": _add_positions(builder, mesh.vertices[vertices], origin)}
        rows = rows_of[like]
        columns = _corner_columns(split.normals[rows], uv.values[uv.of[like]] if uv else None)
        columns |= {name: values[vertices] for name, values in of_vertices.items()}
        attributes |= {name: builder.accessor(values.astype("<f4")) for name, values in columns.items()}
        indices = builder.accessor(faces.astype("<u4").ravel(), ELEMENT_ARRAY_BUFFER)
        if len(runs) > len(asset.parts) and fits_float(vertices):
            attributes[SOURCE_INDEX] = builder.accessor(vertices.astype("<f4"))
        primitive = {"attributes": attributes, "indices": indices, "material": run.material.key + 1}
        builder.header["meshes"][-1]["primitives"].append(primitive)
        drawn.append(Drawn(primitive, vertices, rows))
    return builder, drawn


def _add_positions(builder: GlbBuilder, vertices: Float64s, origin: Float64s | None) -> int:
    """Index of an accessor of positions relative to `origin`, float32, with the bounds that glTF asks for."""
    positions = (vertices - (0 if origin is None else origin)).astype("<f4")
    return builder.accessor(positions, min=positions.min(axis=0).tolist(), max=positions.max(axis=0).tolist())


def _empty_document() -> GlbBuilder:
    """A document with an empty scene and a white material."""
    white = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}
    asset = {"version": "2.0", "generator": "obscurance"}
    scenes: list[dict[str, Any]] = [{"nodes": []}]
    return GlbBuilder({"asset": asset, "scene": 0, "scenes": scenes, "nodes": [], "meshes": [], "materials": [white]})


def _run_vertices(
    mesh: Mesh, part: Part, face_rows: Int64s, split_by: list[PerCorner], keeps_all: bool
) -> tuple[Int64s, Int64s, Int64s]:
    """The vertices (k,) of the mesh that some of its faces get, the faces (m, 3), and a corner like each vertex (k,).

    Args: face_rows: (m,) of the faces, in `part`. split_by: values whose corners divide vertices.
    """
    start = part.vertices.start
    count = part.vertices.stop - start if keeps_all else 0
    corners = 3 * face_rows[:, None] + np.arange(3)
    vertices, faces, like = split_corners(mesh.faces.ravel() - start, corners, split_by, count)
    return vertices + start, faces, like


def _corner_columns(normals: npt.NDArray[Any], uv: npt.NDArray[Any] | None) -> dict[str, npt.NDArray[Any]]:
    """Unit normals, upwards of faces without area, which nothing shows, and texture coordinates of vertices."""
    columns = {"NORMAL": np.where(nonzero(normals)[:, None], normals, (0, 0, 1))}
    if uv is not None and np.isfinite(uv).any():
        columns["TEXCOORD_0"] = flipped(np.nan_to_num(uv))
    return columns


def _add_node(builder: GlbBuilder, name: str, origin: Float64s | None) -> None:
    """Append a node with an empty mesh to the scene."""
    mesh = builder.append("meshes", {"name": name, "primitives": []})
    node: dict[str, Any] = {"name": name, "mesh": mesh}
    if origin is not None:
        node["translation"] = origin.tolist()
    builder.header["scenes"][0]["nodes"].append(builder.append("nodes", node))


def part_origin(vertices: Float64s) -> Float64s | None:
    """The origin of positions that float32 cannot hold about zero, or None. Raises: OptionError: about none it can."""
    if np.abs(vertices).max() > _LARGEST:
        raise OptionError("output", f"coordinates up to {_LARGEST:g} in a .glb", f"{np.abs(vertices).max():g}")
    if np.array_equal(vertices.astype("<f4"), vertices):
        return None
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def _vertex_columns(asset: Asset, colors: str) -> dict[str, npt.NDArray[Any]]:
    """Attributes of the vertices by glTF's names: colours, unless all channels are to hold w, and the source's
    further numbers.

    Args:
        colors: channels of `COLOR_0` that are to hold w.
    """
    colours = asset.colours(grey=bool(colors)) if len(colors) < 2 else None
    columns = {} if colours is None else {"COLOR_0": colours}
    return columns | {f"_{name.upper()}": asset.numbers[name] for name in kept_numbers(asset)}


def kept_numbers(asset: Asset) -> list[str]:
    """Names of the further numbers of vertices that a .glb has: float32 holds them, and capitals do not clash."""
    name_of: dict[str, str] = {}
    for name, values in asset.numbers.items():
        if fits_float(values):
            name_of.setdefault(name.upper(), name)
    return list(name_of.values())


def fits_float(values: npt.NDArray[Any]) -> bool:
    """Whether float32 holds the values exactly."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values).all() and np.array_equal(values.astype("<f4"), values))


def add_materials(builder: GlbBuilder, materials: Sequence[Material]) -> None:
    """Append materials to a document, and to its buffer their pictures, each once."""
    numbers: dict[Any, int] = {}
    for source in materials:
        surface: dict[str, Any] = {"baseColorFactor": [*source.colour, source.opacity]}
        surface |= {"metallicFactor": source.metallic, "roughnessFactor": source.roughness}
        material: dict[str, Any] = {"name": source.name, "pbrMetallicRoughness": surface}
        if any(source.emission):
            material["emissiveFactor"] = list(source.emission)
        if source.alpha == "blend":
            material["alphaMode"] = "BLEND"
        builder.append("materials", material)
        colour, alpha = (used and used.texture for used in (source.texture, source.opacity_texture))
        if not (colour or alpha):
            continue
        key = colour, alpha
        if key not in numbers:
            data = _base_colour(colour, alpha)
            kind = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
            image = {"name": source.pictures[0].name, "mimeType": kind, "bufferView": builder.bytes_view(data)}
            numbers[key] = builder.append("textures", {"source": builder.append("images", image)})
        surface["baseColorTexture"] = {"index": numbers[key]}


def _base_colour(colour: Texture | None, opacity: Texture | None) -> bytes:
    """A PNG or JPEG file of a colour texture, its alpha the opacity map; of two sizes the larger."""
    if colour and opacity in (None, colour):
        return colour.path.read_bytes()
    # Alpha if that is not constant, for exporters name the picture of the colour; else luminance as stored, as
    # Wavefront MTL 5.0 has it for scalar textures.
    assert opacity
    alpha = texture_alpha(opacity, grey=True)
    rgb: npt.NDArray[Any] = rgb_codes(texture_codes(colour)) if colour else np.full((1, 1, 3), 255, np.uint8)
    size = max(rgb.shape[0], len(alpha)), max(rgb.shape[1], alpha.shape[1])
    codes = np.rint(enlarged(alpha[..., None], *size) * 255).astype(np.uint8)
    return linear_png(np.concatenate([enlarged(rgb, *size), codes], axis=2))


def enlarged(image: npt.NDArray[Any], height: int, width: int) -> npt.NDArray[Any]:
    """`image` (h, w, c) by bilinear interpolation, taken to repeat, codes rounded."""
    if image.shape[:2] == (height, width):
        return image.copy()
    from scipy.ndimage import zoom

    factors = height / image.shape[0], width / image.shape[1], 1
    zoomed: npt.NDArray[Any] = zoom(image.astype(np.float32), factors, order=1, mode="grid-wrap", grid_mode=True)
    return zoomed if image.dtype == np.float32 else np.rint(zoomed).astype(image.dtype)
