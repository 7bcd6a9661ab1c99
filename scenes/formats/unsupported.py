"""Warnings of what an output format cannot keep of the mesh file."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obscurance.raytrace.errors import printable

from ..asset.asset import Asset
from ..asset.primitive import COLOR, W
from .obj.mtl import MATERIAL_WORDS
from .obj.text import Obj
from .ply.layout import Ply
from .ply.write import MESHLAB, cuts_polygons, has_own_colors
from .table import Channels, FileFormat, format_of

_NAMES = "names of groups", "its division", "smoothing groups"  # how words on names in an OBJ begin


def unsupported_features(target: Path, asset: Asset, channels: Channels = Channels()) -> list[str]:
    """Losses of `scenes.write`, and unexpected changes: lines for the user, mostly none.

    Raises: OptionError: coordinates that the format does not hold. MeshError: colours to be kept are malformed.
    """
    row = format_of(target)
    colors = channels.colors
    if "source" not in row.holds:
        return []
    missing = [*(_of_glb(asset, channels) if row.ending == ".glb" else _of_polygons(asset, row, colors))]
    if channels.ply_name == MESHLAB and cuts_polygons(asset):
        missing.append("polygons, which become triangles")
    warnings = [f"{target}: not kept from {asset.path}: {', '.join(missing)}"] if missing else []
    if row.name == "PLY" and not colors and has_own_colors(asset):
        instead = "w, the openness, is only in the property obscurance; --colors puts it in their place"
        warnings.append(f"{target}: keeps the colours of {asset.path}; {instead}")
    if channels.ply_name and channels.ply_name in asset.numbers:
        warnings.append(f"{target}: w takes the place of {channels.ply_name} of {asset.path}")
    if channels.ramp and asset.is_scene:
        from .gltf.write import ramp_warnings

        warnings += [f"{target}: {line}" for line in ramp_warnings(asset, channels.replace)]
    return [printable(line) for line in warnings]


def _of_polygons(asset: Asset, row: FileFormat, colors: str) -> Iterator[str]:
    """What a format of polygons leaves out of a mesh file, in words.

    Args: colors: the channels of colours that hold w.
    """
    is_ply = isinstance(asset.raw, Ply)
    is_obj = row.name == "OBJ"  # which has normals and coordinates of corners, and names
    is_stored = is_obj and isinstance(asset.raw, Obj)
    if (len(colors) > 1 or "colors" not in row.holds) and has_own_colors(asset):
        yield "its colours"
    if not is_ply:
        if not asset.is_scene and not is_obj and len(asset.objects) > 1:
            yield "its division into objects"
        kept = (*MATERIAL_WORDS, *(_NAMES if is_stored else ()))
        yield from (words for words in asset.unread if not words.startswith(kept))
    if asset.mesh.corner_normals and not is_obj:
        yield "normals of vertices that have several"
    uv = asset.of_polygons("uv0", missing=(0, 1))
    if uv and "uv" in row.holds and not is_obj and not np.isfinite(uv.values).all():
        yield "texture coordinates, which some corners lack"
    if asset.materials and not is_ply and not asset.is_scene and not is_stored:
        yield "materials but their names" if is_obj else "materials"
    if "colors" not in row.holds:
        yield from (f"{name} of vertices" for name in asset.numbers)
    if uv and "uv" not in row.holds:
        yield "texture coordinates"


def _of_glb(asset: Asset, channels: Channels) -> Iterator[str]:
    """What a .glb leaves out of a mesh file, in words. Raises: as `unsupported_features`."""
    from .gltf.asset import Gltf
    from .gltf.plain import SOURCE_INDEX, kept_numbers, part_origin

    colors = channels.colors
    if asset.is_scene:
        if len(colors) == 1:
            asset.columns(COLOR)  # to find what is malformed
        elif colors and any(COLOR in part.primitive.columns for part in asset.parts):
            yield "its colours"
        if channels.alone and isinstance(asset.raw, Gltf):
            stored = {name for drawn in asset.raw.drawn for name in drawn.stored["attributes"]}
            yield from (f"{name} of vertices" for name in sorted(stored) if name[0] == "_" and W not in name.lower())
        return
    part_origin(asset.mesh.vertices)
    yield from asset.unread
    if has_own_colors(asset) and (len(colors) > 1 or asset.columns(COLOR) is None):
        yield "its colours"
    if len(list(asset.runs())) > len(asset.parts):
        yield "the order of vertices" + (f" ({SOURCE_INDEX} has their places)" if not channels.alone else "")
        if len(np.unique(asset.corners)) < len(asset.mesh.vertices):
            yield "vertices that no face uses"
    if (asset.sizes != 3).any():
        yield "polygons, which become triangles"
    kept_names = [] if channels.alone else kept_numbers(asset)
    yield from (f"{name} of vertices" for name in asset.numbers if name not in kept_names)
    # Of a PLY's elements.
    wedges = [primitive.columns["uv0"].of is not None for primitive in asset.primitives if "uv0" in primitive.columns]
    used = ("vertex_indices", "vertex_index", "texcoord" if any(wedges) else "")
    for element in asset.raw.elements if isinstance(asset.raw, Ply) else ():
        if element.name == "vertex":
            yield from (f"{column.name} of vertices" for column in element.properties if column.counted)
        elif element.name == "face":
            yield from (f"{column.name} of faces" for column in element.properties if column.name not in used)
        elif element.count:
            yield f"elements {element.name}"
