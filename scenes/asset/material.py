"""Materials of mesh files: glTF's factors and Blinn–Phong's, with the textures that are looked up at faces."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from math import cos, sin
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from obscurance.raytrace.errors import InputError, MemoryLimitError
from obscurance.raytrace.mesh.opacity import AlphaSurface, Opacity
from obscurance.raytrace.types import Bools, Float64s

from .primitive import COLOR, RAMP, Column, Primitive

if TYPE_CHECKING:
    from obscurance.raytrace.image.texture import Texture

Colour = tuple[float, float, float]


class Lookup(NamedTuple):
    """A texture, and the texture coordinates by which it is looked up."""

    texture: Texture | None  # None: the picture cannot be had, as `fault` says
    uv: int = 0  # number of the set
    moved: tuple[tuple[float, float], float, tuple[float, float]] | None = None  # scale, rotation, offset, v downwards
    strength: float = 1.0  # of an occlusion texture
    is_ramp: bool = False  # whether it is the grey ramp by which a bake shows w of vertices
    fault: str = ""  # why a picture of colours is left out
    error: Exception | None = None  # which whoever uses it raises

    @property
    def words(self) -> str:
        """The warning that its picture is left out."""
        return f"{self.fault}; the picture is left out"

    def at(self, uv: Float64s) -> Float64s:
        """Where the texture is looked up for texture coordinates (n, 2), all v upwards (KHR_texture_transform)."""
        if self.moved is None:
            return uv
        scale, rotation, offset = self.moved
        c = cos(rotation)
        s = sin(rotation)
        down = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1) * scale @ np.array([[c, -s], [s, c]]) + offset
        return np.stack([down[:, 0], 1 - down[:, 1]], axis=1)


class Material(NamedTuple):
    """A material: linear colours in [0, 1]."""

    name: str
    colour: Colour = (1.0, 1.0, 1.0)
    opacity: float = 1.0
    alpha: Literal["opaque", "mask", "blend"] = "opaque"  # of an opaque one only `opacity` counts, where light passes
    cutoff: float = 0.5  # of a mask
    metallic: float = 0.0
    roughness: float = 1.0
    emission: Colour = (0.0, 0.0, 0.0)
    specular: Colour = (0.0, 0.0, 0.0)  # and `exponent`, of Blinn–Phong; glTF has `roughness`
    exponent: float = 0.0
    texture: Lookup | None = None  # multiplied into `colour`
    opacity_texture: Lookup | None = None  # its alpha, or luminance, multiplied into `opacity`
    occlusion: Lookup | None = None
    images: tuple[tuple[int, Hashable], ...] | None = None  # sets and keys of all its images; None: `texture` alone

    def surface(self, has_uv: bool) -> AlphaSurface | None:
        """The alpha of faces with or without texture coordinates; None: they are opaque."""
        if self.alpha == "opaque":
            return AlphaSurface(self.opacity) if self.opacity < 1 else None
        cutoff = self.cutoff if self.alpha == "mask" else None
        image = self.opacity_texture.texture if self.opacity_texture and has_uv else None
        is_of_colours = self.texture is not None and self.texture.texture == image
        if image is None and self.opacity == 1 and self.opacity_texture is not self.texture:  # of its map alone
            return None
        return AlphaSurface(self.opacity, image, grey=image is not None and not is_of_colours, cutoff=cutoff)

    def image(self, number: int) -> Hashable | None:
        """The key of an image that is looked up by the texture coordinates of this number, or None."""
        images = self.images
        if images is None:
            images = ((self.texture.uv, self.texture.texture),) if self.texture else ()
        return next((key for coordinates, key in images if coordinates == number), None)

    @property
    def pictures(self) -> tuple[Path, ...]:
        """The files of its textures."""
        used = [lookup.texture for lookup in (self.texture, self.opacity_texture) if lookup]
        return tuple(dict.fromkeys(texture.path for texture in used if texture))


def picture(path: Path | None) -> Lookup | None:
    """A lookup of an image file by the first texture coordinates, None of none."""
    from obscurance.raytrace.image.texture import Texture

    return Lookup(Texture(path)) if path else None


def is_picture(path: Path) -> bool:
    """Whether a file begins as a PNG or a JPEG, which glTF and browsers show."""
    with path.open("rb") as file:
        return file.read(8).startswith((b"\x89PNG", b"\xff\xd8\xff"))


def find_picture(name: str, folder: Path) -> Path | None:
    """The existing picture `name` in `folder` or below, or None: `resolve_inside` of PNG and JPEG files."""
    from ..safe_paths import resolve_inside

    path = resolve_inside(name, folder)
    return path if path and is_picture(path) else None


def is_opacity_map(path: Path, colour: Path | None) -> bool:
    """Whether an image, read wholly, can be an opacity map; one that is the `colour`, too, needs an alpha channel."""
    from obscurance.raytrace.image.texture import Texture, texture_codes

    try:
        channels = [texture_codes(Texture(image)).shape[2] for image in {path, colour} if image]
    except MemoryLimitError:
        raise
    except InputError:
        return False
    return path != colour or channels[0] in (2, 4)


def places(primitive: Primitive, lookup: Lookup | None) -> Column | None:
    """Where a lookup reads, v upwards; None without such texture coordinates. Raises: `Lookup.error`."""
    if lookup is None:
        return None
    if lookup.error:
        raise lookup.error
    names = f"uv{lookup.uv}", f"{RAMP}{lookup.uv}"
    column = next((primitive.columns[name] for name in names if name in primitive.columns), None)
    return column and column._replace(values=lookup.at(column.values))


def opacity_of(primitive: Primitive, materials: Sequence[Material], warnings: dict[str, None]) -> Opacity | None:
    """Alpha of a primitive's triangles; None where all are opaque. Args: warnings: gets words on pictures left out."""
    seen_through = {n for n, one in enumerate(materials) if one.surface(False) or one.surface(True)}
    if not seen_through:
        return None
    material_of = primitive.of_faces(primitive.material)
    count = len(material_of)
    of = np.full(count, -1)
    uv = np.zeros((count, 3, 2))
    corners = np.ones((count, 3))
    surfaces: list[AlphaSurface] = []
    colours = primitive.columns.get(COLOR)
    for number in seen_through.intersection(np.unique(material_of).tolist()):
        material = materials[number]
        faces = np.flatnonzero(material_of == number)
        lookup = material.opacity_texture
        where = None if material.alpha == "opaque" else places(primitive, lookup)
        has_uv: Bools = np.zeros(len(faces), np.bool_)
        if lookup and where and lookup.texture is None:
            warnings[lookup.words] = None
        elif where:
            at_corners = where.values[primitive.rows(where)[faces]]
            has_uv = np.asarray(~np.isnan(at_corners).any(axis=(1, 2)))
            uv[faces[has_uv]] = at_corners[has_uv]
        if material.alpha != "opaque" and colours and not colours.srgb and colours.values.shape[1] == 4:
            corners[faces] = colours.values[:, 3].clip(0.0, 1.0)[primitive.rows(colours)[faces]]
        for rows, with_uv in ((faces[has_uv], True), (faces[~has_uv], False)):
            if len(rows) and (surface := material.surface(with_uv)):
                of[rows] = len(surfaces)
                surfaces.append(surface)
    if not surfaces:
        return None
    has_textures = any(surface.texture for surface in surfaces)
    return Opacity(of, tuple(surfaces), uv if has_textures else None, corners if (corners != 1).any() else None)
