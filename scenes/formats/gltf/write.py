"""Obscurance in a binary glTF file: vertex attributes, and an occlusion texture, a grey ramp with coordinates into it.

Linear in u, sampled linearly at a u interpolated linearly, it shows vertex values in any viewer, without an unwrapping.
"""

import copy
from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.image.write import linear_png
from obscurance.raytrace.mesh.mesh import TO_Y_UP, up_axis
from obscurance.raytrace.types import AnyFloats, Float64s

from ...asset.asset import Asset, Part
from ..table import Channels
from .accessors import stored_colors
from .asset import DRACO, MESHOPT, Gltf
from .builder import GlbBuilder
from .occlusion import RAMP, OcclusionTextures, add_coordinates, free_set, kept_in_words
from .plain import Drawn, plain

LEVELS = 256
SETS_OF_ALL_VIEWERS = 2  # the least that viewers must support (section 3.7.2.1)
_ROWS = 4


def glb(bake: Bake, asset: Asset, channels: Channels) -> bytes:
    """A GLB file with vertex attributes of w, and of its error, flags and bent normals as far as they are known
    (`records.LEFT`, float32), and those of a profile.

    A glTF source is kept as stored; only what holds w is added, and meshes that several nodes share are given to each
    node separately, because each instance has its own w. Every other source becomes `plain.plain`.

    Raises: MeshError: malformed materials. OptionError: coordinates of what was no glTF are too large for float32.
    """
    builder, drawn = document(asset, bake, channels)
    if channels.ramp:
        write_ramp(builder, [(one.primitive, bake.w[one.rows]) for one in drawn], channels.replace)
    return builder.encode()


def document(asset: Asset, bake: Bake | None, channels: Channels = Channels()) -> tuple[GlbBuilder, list[Drawn]]:
    """The document of a mesh file, with w of a bake, and its drawn primitives. Raises: as `glb`."""
    raw = asset.raw if isinstance(asset.raw, Gltf) else None
    builder, drawn = stored_document(raw, asset.parts) if raw else plain(asset, channels.colors)
    stored = Gltf(asset.path, builder.header, [bytes(builder.binary)]) if len(channels.colors) == 1 else None
    _add_up_axis_node(builder.header, up_axis(asset.mesh, channels.up), raw)
    builder.describe_bake(channels.record)
    if bake:
        if len(bake.w) == len(asset.mesh.vertices):
            drawn = [one._replace(rows=one.vertices) for one in drawn]
        for primitive, vertices, rows in drawn:
            colors = None if stored is None else stored_colors(stored, primitive["attributes"], len(vertices))
            builder.annotate(primitive, bake, rows, channels, colors)
    return builder, drawn


def stored_document(raw: Gltf, parts: tuple[Part, ...]) -> tuple[GlbBuilder, list[Drawn]]:
    """The document of a glTF source with a mesh of its own for each instance, and its drawn primitives."""
    _ = raw.materials  # to find what is malformed
    builder = one_buffer(raw)
    nodes = builder.header["nodes"]
    meshes = builder.header["meshes"]
    owner: dict[int, int] = {}  # the node that keeps a mesh which several show
    drawn: list[Drawn] = []
    for shown, part in zip(raw.drawn, parts, strict=True):
        node = nodes[shown.node]
        if owner.setdefault(shown.mesh, shown.node) != shown.node and node["mesh"] == shown.mesh:
            meshes.append(copy.deepcopy(meshes[shown.mesh]))
            node["mesh"] = len(meshes) - 1
        vertices = np.arange(part.vertices.start, part.vertices.stop)
        drawn.append(Drawn(meshes[node["mesh"]]["primitives"][shown.primitive_number], vertices, vertices))
    return builder, drawn


def _add_up_axis_node(header: dict[str, Any], up: str, asset: Gltf | None) -> None:
    """Put the roots of the default scene below a node that turns `up` to y, glTF's up axis, if it is another; and
    hidden nodes of the source below one that no scene shows.
    """
    if up == "y":
        return
    roots, hidden = (asset.roots, asset.hidden) if asset else (header["scenes"][0]["nodes"], [])
    matrix = np.eye(4)
    matrix[:3, :3] = TO_Y_UP[up]
    nodes = header["nodes"]
    header.setdefault("scenes", [{}])[header.setdefault("scene", 0)]["nodes"] = [len(nodes)]
    turned = {"name": f"{up} up", "matrix": matrix.T.ravel().tolist()}
    nodes += [turned | {"children": children} for children in (roots, hidden) if children]


def one_buffer(asset: Gltf) -> GlbBuilder:
    """The asset with all buffers joined, and with the images beside it taken in where they can be read."""
    builder = GlbBuilder(copy.deepcopy(asset.header))
    _keep_plain_data(builder.header)
    offsets = [builder.add(buffer) for buffer in asset.buffers]
    for view in builder.header.get("bufferViews", []):
        if view["buffer"] in range(len(offsets)):
            view["byteOffset"] = view.get("byteOffset", 0) + offsets[view["buffer"]]
        else:  # nothing that was read refers to it
            view |= {"byteOffset": 0, "byteLength": 1}
        view["buffer"] = 0
    views: dict[int, int] = {}
    for image in builder.header.get("images", []):
        uri = str(image.get("uri", "data:"))
        data = None if uri.startswith("data:") else asset.referenced(uri)
        if data is not None:
            del image["uri"]
            image.setdefault("mimeType", "image/png" if data.startswith(b"\x89PNG") else "image/jpeg")
            if id(data) not in views:
                views[id(data)] = builder.bytes_view(data)
            image["bufferView"] = views[id(data)]
    return builder


def _keep_plain_data(header: dict[str, Any]) -> None:
    """Take compressed data out of a document wherever it has the plain data too."""
    for view in header.get("bufferViews", []):
        _remove(view, *MESHOPT)
    left = False
    accessors = header.get("accessors", [])
    for primitive in (primitive for mesh in header.get("meshes", []) for primitive in mesh["primitives"]):
        numbers = *primitive["attributes"].values(), primitive.get("indices", len(accessors))
        used = [accessors[number] for number in numbers if number < len(accessors)]
        if all("bufferView" in accessor for accessor in used):
            _remove(primitive, DRACO)
        left |= DRACO in primitive.get("extensions", {})
    for key in ("extensionsUsed", "extensionsRequired"):
        names = [name for name in header.get(key, []) if name not in MESHOPT and (left or name != DRACO)]
        if names:
            header[key] = names
        else:
            header.pop(key, None)


def _remove(entry: dict[str, Any], *names: str) -> None:
    """Drop extensions of an entry, and its table of extensions if none is left."""
    extensions = entry.get("extensions", {})
    for name in names:
        extensions.pop(name, None)
    if not extensions:
        entry.pop("extensions", None)


@cache
def ramp_png() -> bytes:
    """A PNG file of 256 × 4 greys of 8 bits: texel i of a row is i."""
    return linear_png(np.tile(np.arange(LEVELS, dtype=np.uint8), (_ROWS, 1))[..., None])


def ramp_coordinates(w: AnyFloats) -> Float64s:
    """Texture coordinates (n, 2) at which the ramp is w (n,): centres of texels lie at (i + ½)/256."""
    u = ((LEVELS - 1) * np.clip(np.asarray(w, np.float64), 0.0, 1.0) + 0.5) / LEVELS
    return np.stack([u, np.full_like(u, 0.5)], axis=-1)


def write_ramp(builder: GlbBuilder, drawn: Iterable[tuple[dict[str, Any], AnyFloats]], replace: bool) -> None:
    """Give primitives, with w (n,) of their vertices, the ramp as their occlusion texture; `replace`: for any other."""
    textures = OcclusionTextures(builder, replace)
    ramp = None
    for primitive, w in drawn:
        if textures.materials(primitive):
            ramp = textures.add(ramp_png(), RAMP) if ramp is None else ramp
            number = free_set(builder.header, primitive)
            add_coordinates(builder, primitive, number, ramp_coordinates(w))
            textures.give(primitive, ramp, number)
    textures.apply()


def ramp_warnings(asset: Asset, replace: bool) -> list[str]:
    """Warnings where `write_ramp` leaves w out, or some viewers will: lines for the user, mostly none."""
    raw = asset.raw
    assert isinstance(raw, Gltf)
    header = raw.header
    textures = OcclusionTextures(GlbBuilder(header), replace)
    primitives = {drawn[1:3]: drawn.stored for drawn in raw.drawn}.values()
    taking = [primitive for primitive in primitives if textures.materials(primitive)]
    lines = []
    if left_out := len(primitives) - len(taking):
        lines.append(kept_in_words(f"{left_out:,} of {len(primitives):,}"))
    highest = max((free_set(header, primitive) for primitive in taking), default=0)
    if highest >= SETS_OF_ALL_VIEWERS:
        most = f"not every viewer reads more than {SETS_OF_ALL_VIEWERS}"
        lines.append(f"uses the set TEXCOORD_{highest}; {most}: remove sets that are not used")
    return lines
