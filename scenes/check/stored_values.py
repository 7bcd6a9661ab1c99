"""w that a file holds for the mesh of a check, wherever it holds it: of vertices or faces, in colours, in textures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obscurance.raytrace.errors import SceneError
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.texture import Texture, pack_textures
from obscurance.raytrace.image.texture_lookup import sample_points
from obscurance.raytrace.types import Bools, Float64s, Int32s, Int64s

from ..asset.primitive import COLOR, W
from ..formats.images import is_texture
from ..formats.load import parser_errors
from ..formats.ply.layout import Ply, columns_of
from ..formats.stored_w import FaceTextures, occlusion_textures, read_w, w_of_mesh
from ..formats.table import is_raster

if TYPE_CHECKING:
    from ..asset.asset import Asset

_GREY = 0.02  # between channels, up to which colours are grey
_CHANNELS = "red", "green", "blue"
_OTHERS = ".jpg", ".jpeg", ".tga", ".bmp", ".webp", ".hdr"  # endings of images of other programs
_OWN = "values that a bake has left"
_NO_W = "w as obscurance bake writes it, vertex colours or an occlusion texture"


class StoredValues(NamedTuple):
    """w of a file, by how its values may be meant, in words; by one alone, "", if that is known.

    Attributes:
        where: that holds it, in words.
        rows: (n,), of elements. lookups: in their place, w at places on faces (k,) by barycentric coordinates (k, 3).
        faces: (m,), that have it.
    """

    where: str
    rows: dict[str, Float64s]
    lookups: dict[str, Callable[[Int64s, Float64s], Float64s]]
    faces: Bools | None = None

    @property
    def rows_count(self) -> int | None:
        """The number of elements, if values are of some."""
        return len(next(iter(self.rows.values()))) if self.rows else None

    def at(self, rows: Int64s, weights: Float64s | None) -> dict[str, Float64s]:
        """The values (k,) of elements, or at places on faces by barycentric coordinates (k, 3), by their meaning."""
        if weights is None:
            return {meaning: column[rows] for meaning, column in self.rows.items()}
        return {meaning: lookup(rows, weights) for meaning, lookup in self.lookups.items()}

    def interpolated(self, faces: Int32s) -> StoredValues:
        """The values of vertices as they are shown on the faces (m, 3) between them."""

        def lookup(column: Float64s) -> Callable[[Int64s, Float64s], Float64s]:
            return lambda rows, weights: np.einsum("kc,kc->k", weights, column[faces[rows]])

        return self._replace(rows={}, lookups={meaning: lookup(column) for meaning, column in self.rows.items()})


def find_values(file: Path, own: Asset | None, source: Asset, is_own: bool) -> StoredValues:
    """The values of a file. Raises: SceneError: it has none.

    Args: own: the file's mesh, if it has one. source: of the mesh to check it for. is_own: whether a record says that
        the values are w of `obscurance bake`, as it encodes them.
    """
    if own is None and is_image(file) and not (is_raster(file) and is_raster(source.path)):
        uv = source.uv
        if uv is None:
            raise SceneError(source.path, "texture coordinates", f"those that {file.name} is for", "none")
        kinds = {"": False} if is_own else {"linear": False, "sRGB": True}
        of = np.where(np.isnan(uv).any(axis=(1, 2)), -1, 0)
        pages = {kind: FaceTextures(uv, of, [(Texture(file, srgb=srgb), 1.0)]) for kind, srgb in kinds.items()}
        return _textured("the texture", pages)
    if own is None:
        return StoredValues(_OWN, {"": read_w(file)}, {})
    if own.w is not None:
        return StoredValues(_OWN, {"": w_of_mesh(own)}, {})
    if isinstance(own.raw, Ply):  # of points, or of faces
        left = columns_of(own.raw.elements, "vertex" if own.cloud else "face").get(W)
        if left:
            each = left.values if own.cloud else np.repeat(left.values, own.triangles.counts)
            return StoredValues(_OWN, {"": each.astype(np.float64)}, {})
    with parser_errors(file):
        if own.is_scene and (textured := occlusion_textures(own)):
            return _textured("occlusion textures", {"": textured})
    colours = own.columns(COLOR)
    if colours is None or None in colours:
        ramps = own.is_scene and any(own.material(run.material.key).occlusion for run in own.runs())
        if ramps:
            return StoredValues("the ramp of occlusion textures", {"": w_of_mesh(own)}, {})
        raise SceneError(file, "w", _NO_W, "none")
    return StoredValues("vertex colours", _meanings(own), {})


def is_image(file: Path) -> bool:
    """Whether a name is that of an image, of this program or of others."""
    return is_texture(file) or file.suffix.lower() in _OTHERS


def _meanings(own: Asset) -> dict[str, Float64s]:
    """What vertex colours may mean: the grey, or a channel, as it is stored or decoded."""
    columns = [part.primitive.columns[COLOR] for part in own.parts]
    width = min(column.values.shape[1] for column in columns)
    stored = np.clip(np.concatenate([column.colours(column.srgb)[:, :width] for column in columns]), 0.0, 1.0)
    rgb = stored[:, :3]
    is_grey = np.ptp(rgb, axis=1).max() <= _GREY
    values = {"grey": rgb.mean(axis=1)} if is_grey else dict(zip(_CHANNELS, rgb.T, strict=True))
    if width == 4 and np.ptp(stored[:, 3]) > 0:
        values["alpha"] = stored[:, 3]
    linear = {f"{name}, linear": column for name, column in values.items()}
    return linear | {f"{name}, sRGB": decode_srgb(column).astype(np.float64) for name, column in values.items()}


def _textured(where: str, kinds: dict[str, FaceTextures]) -> StoredValues:
    """Values of textures, by how these may be meant."""

    def lookup(on_faces: FaceTextures) -> Callable[[Int64s, Float64s], Float64s]:
        packed = pack_textures([texture for texture, _ in on_faces.textures])

        def at(faces: Int64s, weights: Float64s) -> Float64s:
            """w at places on faces."""
            places = np.einsum("kc,kcd->kd", weights, on_faces.uv[faces])
            w = np.ones(len(faces))
            for number, (_, strength) in enumerate(on_faces.textures):
                rows = np.flatnonzero(on_faces.of[faces] == number)
                linear = np.empty((len(rows), 3))
                sample_points(packed, number, np.ascontiguousarray(places[rows]), linear)
                w[rows] = 1.0 + strength * (linear[:, 0] - 1.0)  # glTF 2.0, section 5.21
            return w

        return at

    has_values = next(iter(kinds.values())).of >= 0
    return StoredValues(where, {}, {kind: lookup(on_faces) for kind, on_faces in kinds.items()}, has_values)
