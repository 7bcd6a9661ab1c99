"""Alpha of a mesh's faces: the share of light that a place of them stops.

As in glTF: alpha is a factor times a texture's alpha times that of vertex colours. With a cutoff a place is opaque
where alpha reaches it and a hole elsewhere (MASK), without one it lets a share 1 − alpha through (BLEND).
Khronos glTF 2.0 specification, 3.9.4, Alpha Coverage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import OptionError, check_type, numbers
from ..image.texture_lookup import blend, four_texels
from ..kernel.jit import inline, kernel
from ..types import AnyInts, Bools, Float32Rows, Float64Grid, Float64Rows, Float64s, Int64Rows, Int64s

if TYPE_CHECKING:
    from ..image.texture import Texture

_BLEND = -1.0  # a cutoff that there is not
_FACE = 2 * 80  # bytes, joined and packed


@dataclass(frozen=True)
class AlphaSurface:
    """The alpha of some faces: factor, texture, and cutoff.

    Attributes:
        factor: alpha, or what a texture's is multiplied by, in [0, 1].
        texture: its alpha channel is taken, which is 1 in an image without one.
        grey: whether an image without an alpha channel holds alpha as its luminance, as OBJ's `map_d` does.
        cutoff: in [0, 1]: places of this alpha or more are opaque, all else is a hole; None: a share 1 − alpha passes.

    Raises:
        OptionError: a number out of range, or no texture.
    """

    factor: float = 1.0
    texture: Texture | None = None
    grey: bool = False
    cutoff: float | None = None

    def __post_init__(self) -> None:
        for name, value in (("factor", self.factor), ("cutoff", 0.0 if self.cutoff is None else self.cutoff)):
            if not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
                raise OptionError(name, "a number from 0 to 1", repr(value), "alpha")
        if self.texture is not None:
            from ..image.texture import Texture

            check_type(self.texture, Texture, "alpha", "texture", "a raytrace.Texture")


class PackedOpacity(NamedTuple):
    """`Opacity` as kernels read it."""

    of: Int64s  # (m,), the surface of each face, −1 where it is opaque
    uv: Float64Grid = np.zeros((0, 3, 2))  # (m, 3, 2), or no rows
    corners: Float64Rows = np.zeros((0, 3))  # (m, 3), factors, or no rows
    factor: Float64s = np.zeros(0)  # (s,) of the surfaces
    cutoff: Float64s = np.zeros(0)  # (s,), below 0 where there is none
    texels: Float32Rows = np.zeros((0, 1), np.float32)  # (t, 1), the images' alpha, rows from the top
    images: Int64Rows = np.zeros((0, 5), np.int64)  # (s, 5): first texel, width, height, 0: no image; modes along u, v
    one_sided: np.int64 = np.int64(0)  # whether rays pass the backs of all faces, 0 or 1

    def only(self, mask: Bools) -> PackedOpacity | None:
        """The opacity of the faces in `mask`, bool (m,), numbered anew; None if these are opaque."""
        if not (self.of[mask] >= 0).any():
            return None
        uv = self.uv[mask] if len(self.uv) else self.uv
        corners = self.corners[mask] if len(self.corners) else self.corners
        return self._replace(of=self.of[mask], uv=uv, corners=corners)


@dataclass(frozen=True, eq=False)
class Opacity:
    """Alpha of the m faces of a mesh.

    Attributes:
        of: int64 (m,), which of `surfaces` each face has, −1: it is opaque.
        surfaces: how alpha is found.
        uv: float64 (m, 3, 2), texture coordinates of the faces' corners, v upwards; None if no surface has a texture.
        corners: float64 (m, 3), further factors in [0, 1] at the faces' corners, or None.

    Raises:
        OptionError: an array has a wrong shape or values out of range.
    """

    of: Int64s
    surfaces: tuple[AlphaSurface, ...]
    uv: Float64s | None = None
    corners: Float64s | None = None

    def __post_init__(self) -> None:
        of = numbers(self.of, "opacity", "of", "an array of integers (m,)").astype(np.int64)
        if of.ndim != 1 or (of != self.of).any() or not ((of >= -1) & (of < len(self.surfaces))).all():
            raise OptionError("of", f"integers (m,) from -1 to {len(self.surfaces) - 1}", self.of, "opacity")
        object.__setattr__(self, "of", of)
        object.__setattr__(self, "surfaces", tuple(self.surfaces))
        for surface in self.surfaces:
            check_type(surface, AlphaSurface, "opacity", "surfaces", "raytrace.AlphaSurfaces in a tuple or list")
        if self.uv is None and any(surface.texture for surface in self.surfaces):
            raise OptionError("uv", "texture coordinates for alpha textures", "none", "opacity")
        for name, shape in (("uv", (len(of), 3, 2)), ("corners", (len(of), 3))):
            if getattr(self, name) is None:
                continue
            values = np.ascontiguousarray(numbers(getattr(self, name), "opacity", name, f"numbers {shape}"))
            if values.shape != shape:
                raise OptionError(name, f"shape {shape}", values.shape, "opacity")
            bad = ~np.isfinite(values) if name == "uv" else ~((values >= 0) & (values <= 1))
            if bad.any():
                expected = "finite numbers" if name == "uv" else "numbers from 0 to 1"
                raise OptionError(name, expected, values[bad][0], "opacity")
            object.__setattr__(self, name, values)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of faces with a cutoff, and of blended ones."""
        cut = np.array([*(surface.cutoff is not None for surface in self.surfaces), False])[self.of]
        return {"cut_out": int(cut.sum()), "blended": int((self.of >= 0).sum() - cut.sum())}

    @property
    def summary(self) -> str:
        """`counts` in words."""
        return "alpha: {cut_out:,} faces cut out, {blended:,} blended".format(**self.counts)

    @classmethod
    def uniform(cls, surface: AlphaSurface, faces: AnyInts, uv: Float64s | None = None) -> Opacity:
        """The opacity of faces (m, 3) that all have one surface. Args: uv: (n, 2), of the vertices."""
        return cls(np.zeros(len(faces), np.int64), (surface,), None if uv is None else uv[faces])

    def only(self, faces: Int64s) -> Opacity:
        """The opacity of some faces, by their rows."""
        uv = None if self.uv is None else self.uv[faces]
        corners = None if self.corners is None else self.corners[faces]
        return replace(self, of=self.of[faces], uv=uv, corners=corners)

    def reversed(self) -> Opacity:
        """The opacity of the same faces with their corners in reverse order."""
        uv = None if self.uv is None else self.uv[:, ::-1]
        corners = None if self.corners is None else self.corners[:, ::-1]
        return replace(self, uv=uv, corners=corners)

    @staticmethod
    def joined(opacities: Sequence[Opacity | None], counts: Sequence[int]) -> Opacity | None:
        """The opacities of several meshes as one, of their faces one after another.

        Args: counts: of each mesh's faces.
        """
        if all(opacity is None for opacity in opacities):
            return None
        parts = [opacity or Opacity(np.full(count, -1), ()) for opacity, count in zip(opacities, counts, strict=True)]
        starts = np.cumsum([0] + [len(part.surfaces) for part in parts[:-1]])
        of = [np.where(part.of < 0, -1, part.of + start) for part, start in zip(parts, starts, strict=True)]
        surfaces = tuple(surface for part in parts for surface in part.surfaces)
        uv = [np.zeros((len(part.of), 3, 2)) if part.uv is None else part.uv for part in parts]
        corners = np.concatenate([np.ones((len(p.of), 3)) if p.corners is None else p.corners for p in parts])
        has_uv = any(part.uv is not None for part in parts)
        has_corners = (corners != 1).any()
        return Opacity(
            np.concatenate(of), surfaces, np.concatenate(uv) if has_uv else None, corners if has_corners else None
        )

    def packed(self) -> PackedOpacity | None:
        """The opacity as kernels read it, each image once; None if all faces are opaque. Raises: InputError."""
        from ..image.texture import WRAPS, texture_alpha

        of = self.of.copy()
        texels = [np.zeros((0, 1), np.float32)]
        end = 0
        images = np.zeros((len(self.surfaces), 5), np.int64)
        cutoff = np.array([_BLEND if surface.cutoff is None else surface.cutoff for surface in self.surfaces])
        stored: dict[tuple[Texture, bool], tuple[int, int, int, float]] = {}
        # Each surface with faces: its image, once for all that share it, and the least alpha it has.
        for number, surface in enumerate(self.surfaces):
            faces = self.of == number
            if not faces.any():
                continue
            least = surface.factor if self.corners is None else surface.factor * self.corners[faces].min()
            if surface.texture is not None:
                key = replace(surface.texture, wrap=("repeat", "repeat")), surface.grey
                if key not in stored:
                    values = texture_alpha(surface.texture, surface.grey)
                    stored[key] = end, values.shape[1], values.shape[0], float(values.min())
                    texels.append(values.reshape(-1, 1))
                    end += values.size
                *image, lowest = stored[key]
                images[number] = *image, *(WRAPS.index(mode) for mode in surface.texture.wrap)
                least *= lowest
            # Faces that are opaque wherever one looks.
            if least >= (1.0 if surface.cutoff is None else surface.cutoff):
                of[faces] = -1
        if (of < 0).all():
            return None
        uv = np.zeros((0, 3, 2)) if self.uv is None else self.uv
        corners = np.zeros((0, 3)) if self.corners is None else self.corners
        factor = np.array([surface.factor for surface in self.surfaces], np.float64)
        return PackedOpacity(of, uv, corners, factor, cutoff, np.concatenate(texels), images)


def opacity_bytes(opacities: Sequence[Opacity]) -> int:
    """Bytes that opacities take at the peak of being joined and packed; images count by their headers."""
    if not opacities:
        return 0
    from ..image.texture import texel_counts

    images = (surface.texture for opacity in opacities for surface in opacity.surfaces if surface.texture)
    return _FACE * sum(len(opacity.of) for opacity in opacities) + 2 * 4 * sum(texel_counts(images))


@inline
def alpha(opacity, face, u, v):
    """Opacity in [0, 1] of a place on a face, 0 or 1 where the surface has a cutoff. Args: u, v: as Embree has them."""
    surface = opacity.of[face]
    if surface < 0:
        return 1.0
    a = opacity.factor[surface]
    first_weight = 1.0 - u - v
    if len(opacity.corners) > 0:
        at = opacity.corners[face]
        a *= first_weight * at[0] + u * at[1] + v * at[2]
    if opacity.images[surface, 1] > 0:
        at = opacity.uv[face]
        s = first_weight * at[0, 0] + u * at[1, 0] + v * at[2, 0]
        t = first_weight * at[0, 1] + u * at[1, 1] + v * at[2, 1]
        image = opacity.images[surface]
        a *= blend(opacity.texels, four_texels(image[:3], image[3:], s, t), 0)
    if opacity.cutoff[surface] < 0.0:
        return min(max(a, 0.0), 1.0)
    return 1.0 if a >= opacity.cutoff[surface] else 0.0


@kernel
def alphas(opacity: PackedOpacity, faces: Int64s, barycentric: Float64Rows, out: Float64s) -> None:
    """Write the opacity (k,) at barycentric places (k, 2) of faces (k,)."""
    for row in range(len(faces)):
        out[row] = alpha(opacity, faces[row], barycentric[row, 0], barycentric[row, 1])
