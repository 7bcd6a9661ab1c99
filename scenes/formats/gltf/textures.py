"""Textures of a glTF file, by the coordinates of its primitives; alpha of their faces, colours of their vertices.

Of samplers the wrap modes are read; filtering is the renderer's. Format: Khronos glTF 2.0 specification, sections
3.6.2, 3.7.2.1 (`COLOR_0`), 3.8, 3.9.2 to 3.9.4 and 5.26; KHR_texture_transform, EXT_texture_webp;
KHR_materials_transmission.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from math import cos, sin
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from obscurance.raytrace import AlphaSurface, Opacity
from obscurance.raytrace.errors import InputError, MeshError, SceneError
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.image.texture import Texture, Wrap, texture_mean
from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.types import Float64s, Int64s

from ...geometry.attributes import SourceAttributes, triangle_attributes
from ...geometry.instances import Submesh
from ...json_toml import shown
from ...safe_paths import confined, resolve_uri
from .accessors import column, flipped, view_bytes
from .asset import Gltf, entry
from .occlusion import ramp_sets
from .records import TRANSMISSION, GltfMaterial, GltfTexture, Primitive, TextureReference

_ROUNDING = 0.51 / 255  # of the grey that a bake writes
_MODES: dict[int, Wrap] = {10497: "repeat", 33648: "mirrored_repeat", 33071: "clamp_to_edge"}
_READ = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "_OBSCURANCE")
_WORDS = {
    "materials": "materials", "textures": "textures", "animations": "animations", "skins": "skins",
    "cameras": "cameras", "extensionsUsed": "extensions",
}  # fmt: skip


@dataclass(eq=False)
class Textures:
    """The textures of an asset, each made once; `notes` names pictures that cannot be had, which are left out."""

    asset: Gltf
    notes: dict[str, None] = field(default_factory=dict)
    _made: dict[tuple[int, tuple[Wrap, Wrap], bool], Texture] = field(default_factory=dict)

    def of_base(self, primitive: Primitive, needed: bool = False) -> tuple[Float64s, Texture] | None:
        """Coordinates uv (n, 2), v upwards, and the base colour texture of a primitive that has both, or None.

        Args: needed: give also a picture in a format that is not read, which who reads it refuses by name.
        """
        return self._lookup(primitive, self.asset.material(primitive).base[1], srgb=True, needed=needed)

    def of_occlusion(self, primitive: Primitive) -> tuple[Float64s, Texture, float] | None:
        """Coordinates, the occlusion texture, whose R channel is linear, and its strength in [0, 1]; None without
        either."""
        reference = self.asset.material(primitive).occlusionTexture
        used = self._lookup(primitive, reference, srgb=False)
        return None if reference is None or used is None else (*used, float(np.clip(reference.strength, 0.0, 1.0)))

    def transmission(self, material: GltfMaterial) -> float:
        """The share t in [0, 1] of light that passes a material: its factor, times the mean of its texture."""
        share = float(np.clip(material.transmission.transmissionFactor, 0.0, 1.0))
        reference = material.transmission.transmissionTexture
        if share and reference:
            stored = entry(self.asset.materials.textures, reference.index, "textures")
            if stored.image is not None:
                try:
                    share *= float(texture_mean(replace(self.image(stored.image), srgb=False))[0])
                except InputError as fault:
                    self._leave_out(str(fault).removeprefix(f"{self.asset.path}: "))
        return share

    def _lookup(
        self, primitive: Primitive, reference: TextureReference | None, srgb: bool, needed: bool = False
    ) -> tuple[Float64s, Texture] | None:
        """Coordinates (n, 2), v upwards, and the texture of a reference; None if the primitive or the file lacks
        either, or the picture cannot be had, which `notes` then says."""
        if reference is None:
            return None
        moved = reference.transform
        number = reference.texCoord if moved.texCoord is None else moved.texCoord
        stored = entry(self.asset.materials.textures, reference.index, "textures")
        uv = column(self.asset, primitive, f"TEXCOORD_{number}", "VEC2")
        image = stored.unreadable if needed and stored.image is None else stored.image
        if uv is None or image is None:
            if uv is not None and stored.extensions:
                got = ", ".join(stored.extensions)
                self._leave_out(f"textures[{reference.index}]: expected a PNG, JPEG or WebP picture, got {got}")
            return None
        key = image, self._wrap(stored), srgb
        if key not in self._made:
            try:
                self._made[key] = replace(self.image(image), wrap=key[1], srgb=srgb)
            except SceneError as fault:
                self._leave_out(str(fault).removeprefix(f"{self.asset.path}: "))
                return None
        if vars(moved):  # scaled, turned anticlockwise as seen, then moved
            c = cos(moved.rotation)
            s = sin(moved.rotation)
            uv = (uv * moved.scale) @ np.array([[c, -s], [s, c]]) + moved.offset
        return flipped(uv), self._made[key]

    def _leave_out(self, fault: str) -> None:
        self.notes[f"{fault}; the picture is left out"] = None

    def _wrap(self, texture: GltfTexture) -> tuple[Wrap, Wrap]:
        """Wrap modes along u and v of a texture. Raises: MeshError: modes of no name."""
        sampler = self.asset.sampler(texture)
        for name in ("wrapS", "wrapT"):
            got = getattr(sampler, name)
            if not isinstance(got, int) or got not in _MODES:
                field = f"samplers[{texture.sampler}].{name}"
                raise MeshError(self.asset.path, field, "10497, 33648 or 33071", shown(got))
        return _MODES[sampler.wrapS], _MODES[sampler.wrapT]

    def image(self, number: int) -> Texture:
        """An image of the asset, as a texture that repeats. Raises: SceneError: it is missing, or elsewhere."""
        stored = entry(self.asset.geometry.images, number, "images")
        label = self.asset.path.with_name(f"{self.asset.path.name}: images[{number}]")
        if stored.bufferView is not None:
            return Texture(label, data=bytes(view_bytes(self.asset, stored.bufferView)))
        field = f"images[{number}].uri"
        if stored.uri.startswith("data:"):
            data = self.asset.referenced(stored.uri)
            if not data:
                raise SceneError(self.asset.path, field, "an image in base64", shown(stored.uri))
            return Texture(label, data)
        folder = self.asset.path.parent
        return Texture(resolve_uri(stored.uri, folder) or confined(unquote(stored.uri), folder, self.asset.path, field))


def opacity_of(textures: Textures, primitive: Primitive, faces: Int64s) -> Opacity | None:
    """Alpha of the faces (m, 3): base colour factor, its texture and COLOR_0, times 1 − t where a share t of the light
    is transmitted; None where all is opaque."""
    material = textures.asset.material(primitive)
    transmitted = textures.transmission(material)
    if material.alphaMode == "OPAQUE":
        return Opacity.uniform(AlphaSurface(1.0 - transmitted), faces) if transmitted else None
    uv, texture = textures.of_base(primitive, needed=True) or (None, None)
    cutoff = material.alphaCutoff if material.alphaMode == "MASK" else None
    if transmitted and cutoff is not None:
        textures.notes[f"materials[{primitive.material}]: {TRANSMISSION} of what is cut out is not read"] = None
    through = 1.0 if cutoff is not None else 1.0 - transmitted
    alpha = AlphaSurface(float(np.clip(material.base[0][3], 0, 1)) * through, texture, cutoff=cutoff)
    number = primitive.attributes.get("COLOR_0")
    accessors = textures.asset.geometry.accessors
    corners = None
    if number is not None and entry(accessors, number, "accessors").type == "VEC4":
        colours = column(textures.asset, primitive, "COLOR_0", "VEC4")
        corners = None if colours is None else colours[:, 3].clip(0.0, 1.0)[faces]
    return replace(Opacity.uniform(alpha, faces, uv), corners=corners)


def vertex_colours(asset: Gltf, primitive: Primitive, w: npt.NDArray[Any] | None) -> Float64s | None:
    """Linear RGB (n, 3) in [0, 1] of a primitive's vertices, or None; the grey that shows their w is no colour."""
    stored = column(asset, primitive, "COLOR_0", "VEC3", "VEC4")
    if stored is None:
        return None
    colours = stored[:, :3].clip(0.0, 1.0)
    return None if w is not None and (np.abs(colours - w.clip(0, 1)[:, None]) < _ROUNDING).all() else colours


def gltf_attributes(asset: Gltf, parts: Sequence[Submesh], faces: Int64s) -> tuple[SourceAttributes, tuple[str, ...]]:
    """The first texture coordinates and colours of all vertices, and what else the file holds, in words."""
    unread = [words for key, words in _WORDS.items() if asset.header.get(key)]
    if len(parts) > 1:
        unread.insert(0, "nodes")
    # Attributes of the primitives, without the coordinates of a ramp of ours.
    names = [
        drawn.primitive.attributes.keys() - {f"TEXCOORD_{number}" for number in ramp_sets(asset.header, drawn.stored)}
        for drawn in asset.drawn
    ]
    unread += sorted(set[str]().union(*names) - set(_READ))
    columns = {}
    for name, kinds, missing in (("TEXCOORD_0", ("VEC2",), 0.0), ("COLOR_0", ("VEC3", "VEC4"), 1.0)):
        try:
            columns[name] = _column(asset, parts, names, name, kinds, missing)
        except (ValueError, KeyError, TypeError):
            unread.append(name)
    uv = columns.get("TEXCOORD_0")
    # Colours sRGB-encoded, as in other formats, without an alpha of 1.
    colors = columns.get("COLOR_0")
    if colors is not None:
        colors = np.concatenate([encode_srgb(colors[:, :3]).astype(np.float64), colors[:, 3:]], axis=1)
        colors = colors[:, :3] if (colors[:, 3] == 1).all() else colors
    attributes = triangle_attributes(faces)
    coordinates = None if uv is None else PerCorner(flipped(uv), attributes.corners)
    return attributes._replace(uv=coordinates, colors=colors), tuple(unread)


def texture_coordinates(asset: Gltf, parts: Sequence[Submesh], faces: Int64s, number: int) -> Float64s | None:
    """The set TEXCOORD_`number` of all drawn primitives by corner (m, 3, 2), v upwards, NaN where one lacks it; None
    if all do.

    Raises: MeshError: values that are not finite, or not one for each vertex.
    """
    name = f"TEXCOORD_{number}"
    try:
        uv = _column(asset, parts, [drawn.primitive.attributes for drawn in asset.drawn], name, ("VEC2",), np.nan)
    except (ValueError, KeyError, TypeError) as reason:
        raise MeshError(asset.path, name, "two numbers a vertex", reason) from None
    return None if uv is None else flipped(uv)[faces]


def _column(
    asset: Gltf,
    parts: Sequence[Submesh],
    names: Sequence[Collection[str]],
    name: str,
    kinds: tuple[str, ...],
    missing: float,
) -> Float64s | None:
    """An attribute of all drawn vertices, by its name; None if no primitive has it. Raises: as `column`.

    Args:
        names: that each primitive has.
        kinds: types of accessors, of which the last has most columns.
        missing: the value for vertices of a primitive that lacks it.
    """
    if not any(name in names_of_part for names_of_part in names):
        return None
    column_values = np.full((parts[-1].vertices.stop, int(kinds[-1][-1])), missing)
    for drawn, part, names_of_part in zip(asset.drawn, parts, names, strict=True):
        values = column(asset, drawn.primitive, name, *kinds) if name in names_of_part else None
        if values is not None:
            column_values[part.vertices, : values.shape[1]] = values
    return column_values
