"""Base colours of a mesh file for a page: of materials and vertices at the corners of faces, and textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import InputError, MeshError, printable
from obscurance.raytrace.image.colour import decode_srgb, encode_srgb, rgb_codes
from obscurance.raytrace.image.texture import Texture, Wrap, texture_alpha, texture_codes
from obscurance.raytrace.image.write import image_bytes, linear_png, write_picture
from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.mesh.opacity import AlphaSurface, Opacity
from obscurance.raytrace.types import AnyFloats, Float64s, Int64s, UInt8s

from ...asset.asset import Asset
from ...asset.material import places
from ...formats.load import parser_errors

Picture = tuple[Texture | None, AlphaSurface | None]  # of colours, and what of it is there
_PLACES = (1 << 20) - 1  # steps of texture coordinates
_LARGEST, _MANY = 1024, 8  # texels a side of so many images
_SMALL = 1 << 20  # bytes of a file that is embedded as it is
_SHOWN = b"\x89PNG", b"\xff\xd8\xff"  # first bytes of files that browsers show


@dataclass(frozen=True, eq=False)
class BaseColour:
    """Base colours of m faces."""

    codes: UInt8s  # (m, 3, 3), sRGB of each corner, a factor of the texture
    uv: Float64s  # (m, 3, 2), v downwards
    of: Int64s  # (m,), the image of each face, −1 for none
    images: Sequence[bytes]  # files that browsers show
    wraps: Sequence[tuple[Wrap, Wrap]]  # modes of each along u and v
    alpha: UInt8s | None = None  # (m, 3), of each corner, a factor of the image's; None: all is opaque

    def several(self) -> list[PerCorner]:
        """What vertices are repeated for, besides creases: colours and texture coordinates of their corners."""
        alpha = 0 if self.alpha is None else self.alpha.ravel().astype(np.int64) << 24
        colour = self.codes.reshape(-1, 3) @ np.array([1 << 16, 1 << 8, 1]) + alpha
        keys = [colour, uv_steps(self.uv.reshape(-1, 2))[0] @ [1 << 20, 1]] if self.images else [colour]
        return [PerCorner(np.empty((0, 0)), np.unique(key, return_inverse=True)[1]) for key in keys]

    def put(self, columns: dict[str, npt.NDArray[Any]], like: Int64s) -> dict[str, Any]:
        """Write the colours into a page's columns; returns what the page's script must know of them.

        Args: like: (k,), a corner for each vertex of the page.
        """
        columns["base"] = self.codes.reshape(-1, 3)[like]
        if self.alpha is not None:
            columns["alpha"] = self.alpha.ravel()[like]
        steps, scale = uv_steps(self.uv.reshape(-1, 2))
        if self.images:
            columns["baseUv"] = steps[like].astype("<u4")
        for number, image in enumerate(self.images):
            columns[f"image{number}"] = np.frombuffer(image, np.uint8)
        return {"wraps": self.wraps, **scale}


def uv_steps(uv: Float64s) -> tuple[Int64s, dict[str, list[float]]]:
    """Texture coordinates (n, 2) as whole steps, and what a page's script must know of these."""
    low = uv.min(axis=0)
    high = uv.max(axis=0)
    step = np.where(high > low, high - low, 1.0) / _PLACES
    return np.rint((uv - low) / step).astype(np.int64), {"uvLow": low.tolist(), "uvStep": step.tolist()}


def base_colour(file: Asset) -> BaseColour | str | None:
    """Base colours of a file loaded for a page; why they cannot be shown, in words; or None if all is white."""
    try:
        return _read(file)
    except InputError as fault:
        return printable(str(fault))


class _Collected:
    """Base colours of m faces, white at first.

    Attributes: light: linear RGB (m, 3, 3). uv: (m, 3, 2), v upwards. image_of: (m,) in `pictures`, −1 for none.
        alpha: (m, 3). pictures: of colours, of alpha, or both.
    """

    def __init__(self, count: int) -> None:
        self.light = np.ones((count, 3, 3))
        self.uv = np.zeros((count, 3, 2))
        self.image_of = np.full(count, -1)
        self.alpha = np.ones((count, 3))
        self.pictures: list[Picture] = []

    def number(self, texture: Texture | None, surface: AlphaSurface | None = None) -> int:
        """The number of a picture, added if it is new. Args: texture: of colour. surface: of alpha."""
        picture = texture, surface
        if picture not in self.pictures:
            self.pictures.append(picture)
        return self.pictures.index(picture)


def _read(file: Asset) -> BaseColour | None:
    """The base colours of a file, None if all is white and opaque."""
    collected = _Collected(len(file.mesh.faces))
    with parser_errors(file.path):
        _collect_colours(file, collected)
    if file.mesh.opacity:
        _collect_alpha(file.mesh.opacity, collected)
    # Pictures that some face uses, numbered anew.
    used = np.unique(collected.image_of[collected.image_of >= 0])
    collected.image_of = np.where(collected.image_of < 0, -1, np.searchsorted(used, collected.image_of))
    collected.pictures = [collected.pictures[number] for number in used]
    is_opaque = (collected.alpha == 1).all() and not any(surface for _, surface in collected.pictures)
    if (collected.image_of < 0).all() and (collected.light == 1).all() and is_opaque:
        return None
    codes = np.rint(255 * encode_srgb(collected.light.clip(0, 1).astype(np.float32))).astype(np.uint8)
    side = _LARGEST
    while len(collected.pictures) * side**2 > _MANY * _LARGEST**2 and side > 1:
        side //= 2
    images = [_image(picture, side) for picture in collected.pictures]
    wraps = [texture.wrap for picture in collected.pictures for texture in _textures_of(picture)[:1]]
    alpha = None if is_opaque else np.rint(255 * collected.alpha).astype(np.uint8)
    return BaseColour(codes, collected.uv * (1, -1) + (0, 1), collected.image_of, images, wraps, alpha)


def _collect_colours(file: Asset, collected: _Collected) -> None:
    """Colours of vertices times those of materials, and the materials' images where there are texture coordinates.

    Raises: MeshError: a picture cannot be had.
    """
    left_out: dict[str, None] = {}
    for run in file.runs():
        part = file.parts[run.part]
        material = file.material(run.material.key)
        rows = run.faces - part.faces.start
        colours = part.primitive.shown_colours
        collected.light[run.faces] = material.colour
        if colours is not None:
            collected.light[run.faces] *= colours[part.primitive.faces[rows]]
        where = places(part.primitive, material.texture)
        if material.texture and where:
            if material.texture.fault:
                left_out[material.texture.words] = None
            elif material.texture.texture:
                uv = where.values[part.primitive.rows(where)[rows]]
                has_uv = ~np.isnan(uv).any(axis=(1, 2))
                collected.uv[run.faces[has_uv]] = uv[has_uv]
                collected.image_of[run.faces[has_uv]] = collected.number(material.texture.texture)
    if left_out:
        raise MeshError(file.path, "colours", "the pictures of all materials", "; ".join(left_out))


def _collect_alpha(opacity: Opacity, collected: _Collected) -> None:
    """Collect the alpha of corners and of images; with a cutoff it is 0 or 1.

    A face whose colour has an image looks up its image of alpha at the same place.
    """
    for number, surface in enumerate(opacity.surfaces):
        faces = np.flatnonzero(opacity.of == number)
        corners = np.ones((len(faces), 3)) if opacity.corners is None else opacity.corners[faces]
        alpha = surface.factor * corners
        if surface.texture is None or opacity.uv is None:
            collected.alpha[faces] = alpha if surface.cutoff is None else alpha >= surface.cutoff
            continue
        collected.alpha[faces] = alpha if surface.cutoff is None else 1
        is_bare = collected.image_of[faces] < 0
        collected.uv[faces[is_bare]] = opacity.uv[faces[is_bare]]
        for image in np.unique(collected.image_of[faces]).tolist():
            texture = collected.pictures[image][0] if image >= 0 else None
            collected.image_of[faces[collected.image_of[faces] == image]] = collected.number(texture, surface)


def shrunk(image: UInt8s, most: int) -> UInt8s:
    """An image (h, w, …) of at most `most` texels across and down, by means over blocks."""
    size = [-(-side // -(-side // most)) for side in image.shape[:2]]
    if tuple(size) == image.shape[:2]:
        return image
    return np.rint(block_means(image.astype(np.float64), *size)).astype(np.uint8)


def block_means(image: AnyFloats, high: int, wide: int) -> AnyFloats:
    """An image (h, w, …) of another size, by means over blocks."""
    sides = tuple(zip((high, wide), image.shape, strict=False))
    starts = [np.arange(size) * side // size for size, side in sides]
    sums = np.add.reduceat(np.add.reduceat(image, starts[0], axis=0), starts[1], axis=1)
    counts = [np.maximum(np.diff(start, append=side), 1) for start, (_, side) in zip(starts, sides, strict=True)]
    return np.asarray((sums.T / np.outer(*counts).T).T)


def _textures_of(picture: Picture) -> list[Texture]:
    """The image of colour and that of alpha of a picture, as far as it has them."""
    texture, surface = picture
    return [used for used in (texture, surface and surface.texture) if used]


def _image(picture: Picture, most: int) -> bytes:
    """The image file of a picture for a page.

    It is the texture's own file if that is small and opaque, else a JPEG of at most `most` texels a side, or a PNG with
    alpha.
    """
    texture, surface = picture
    if surface and surface.texture:
        return _image_with_alpha(texture, surface, surface.texture, most)
    assert texture
    codes: npt.NDArray[Any] = texture_codes(texture)
    data = texture.path.read_bytes() if texture.data is None else texture.data
    is_opaque = codes.shape[2] in (1, 3)
    if is_opaque and max(codes.shape[:2]) <= most and len(data) <= _SMALL and data.startswith(_SHOWN):
        return data
    small = shrunk(rgb_codes(codes), most)
    return image_bytes("small.jpg", write_picture, decode_srgb(small / np.float32(255)).astype(np.float32), {})


def _image_with_alpha(texture: Texture | None, surface: AlphaSurface, of_alpha: Texture, most: int) -> bytes:
    """A PNG of RGBA; alpha, with a cutoff, is 0 or 255."""
    alpha = texture_alpha(of_alpha, surface.grey)
    if surface.cutoff is not None:
        alpha = (surface.factor * alpha >= surface.cutoff).astype(np.float32)
    white = np.full((1, 1, 3), 255, np.uint8)
    layers = [rgb_codes(texture_codes(texture)) if texture else white, np.rint(255 * alpha[..., None]).astype(np.uint8)]
    high, wide = (min(max(layer.shape[axis] for layer in layers), most) for axis in range(2))
    fitted = [block_means(layer.astype(np.float64), high, wide) for layer in layers]
    return linear_png(np.rint(np.concatenate(fitted, axis=2)).astype(np.uint8))
