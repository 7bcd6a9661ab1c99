"""A mesh and its bakes as the bytes that a page holds: rounded to a few bits, in an order that compresses well.

Positions are 16-bit steps of the bounding box, w 16-bit, error 8-bit on a scale that is finer near 0, flags 8-bit, unit
vectors octahedral (Cigolle et al. 2014). Vertices at creases are stored again for each further normal. Faces are sorted
and stored as differences, as are the texels of textures, and the 8-bit columns of a profile each to the one before. Of
numbers of several bytes, all first bytes come first, then all second ones.
"""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from obscurance.raytrace import Mesh, OptionError
from obscurance.raytrace.errors import numbers
from obscurance.raytrace.image.texture import Wrap
from obscurance.raytrace.mesh.corners import split_creases
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import AnyFloats, Float64s, Int32s, Int64s, UInt8s

from ...asset.primitive import StoredBake
from .base_colour import BaseColour, shrunk, uv_steps

if TYPE_CHECKING:
    from obscurance.ao import Bake, Profile

MOST = 65535
_STEPS = 16  # of a page's half-distance, an octave
_LARGEST = 2048  # texels of a texture across or down, which every browser takes


@dataclass(frozen=True, eq=False)
class TexturedW:
    """w in textures."""

    uv: Float64s  # (n, 2), a place for each vertex, v downwards
    of: Int64s  # (n,), the texture of each vertex's faces, −1 for none
    images: Sequence[UInt8s]  # (h, w) each, 255 w, the uppermost row first
    wraps: Sequence[tuple[Wrap, Wrap]]  # modes of each along u and v


@dataclass(frozen=True, eq=False)
class Values(StoredBake):
    """Values of a bake at n vertices, and what a page says of them."""

    name: str = "bake"
    textures: TexturedW | None = None  # what shows w in place of the vertices
    permanent: str = 'baked.profile.at("{}")'  # the command that bakes a half-distance, which "{}" stands for
    warning: str = ""  # about the result, said first

    @classmethod
    def of(cls, bake: Bake | StoredBake, name: str, **more: Any) -> Self:
        """The values of a bake."""
        return cls(bake.w, bake.error, bake.flags, bake.bent_normals, bake.profile, bake.rmse, name=name, **more)

    def checked(self, count: int) -> Values:
        """The values as float64 and uint8 arrays of `count` vertices. Raises: OptionError: one of another length."""
        arrays: dict[str, Any] = {}
        for field, columns, least, most, expected in (
            ("w", (), 0, 1, "numbers in [0, 1]"),
            ("error", (), 0, 100, "numbers in [0, 100]"),
            ("flags", (), 0, 255, "whole numbers from 0 to 255"),
            ("bent_normals", (3,), -np.inf, np.inf, "finite numbers"),
        ):
            values = getattr(self, field)
            shape = count, *columns
            if values is None:
                continue
            array = numbers(values, self.name, field, f"an array of numbers, shape {shape}")
            if array.shape != shape:
                raise OptionError(field, f"shape {shape}", array.shape, self.name)
            bad = ~np.isfinite(array) | (array < least) | (array > most)
            if bad.any():
                raise OptionError(field, expected, array[bad][0], self.name)
            arrays[field] = array.astype(np.uint8) if field == "flags" else array
        if self.profile and self.profile.values.shape[:-1] != (count,):
            raise OptionError("profile", f"{count:,} rows", self.profile.values.shape, self.name)
        return replace(self, **arrays)


def encoded(mesh: Mesh, bakes: Sequence[Values], base: BaseColour | None = None) -> tuple[dict[str, Any], bytes]:
    """A page's data: a JSON-ready header, and gzip-compressed arrays. Args: bakes: checked."""
    # Positions as steps of the bounding box; corners in the order of the sorted faces.
    low, high = mesh.bounds
    step = (high - low) / MOST
    steps = np.rint(np.divide(mesh.vertices - low, step, out=np.zeros_like(mesh.vertices), where=step > 0))
    order = _sorted(mesh.faces, base.of if base else None)
    faces = mesh.faces.ravel()[order]
    # Vertices at creases, stored again.
    split, normals, _, like = split_creases(mesh, base.several() if base else ())
    drawn = split.faces.ravel()[order.ravel()]
    again = np.flatnonzero(drawn >= len(mesh.vertices))  # corners whose normal is not the first of their vertex
    columns: dict[str, npt.NDArray[Any]] = {
        "faces": _differences(faces).astype("<u4"),
        "positions": np.clip(steps, 0, MOST).astype("<u2"),
        "normals": _octahedral(normals, MOST).astype("<u2"),
        "again": np.diff(again, prepend=0).astype("<u4"),
        "further": (drawn[again] - len(mesh.vertices)).astype("<u4"),
    }
    described = [_bake_columns(bake, number, columns) for number, bake in enumerate(bakes)]
    # What each face shows: a texture of each bake, and an image of base colours.
    shown = np.full((len(bakes) + 1, len(faces)), -1)
    for number, bake in enumerate(bakes):
        if bake.textures:
            shown[number] = bake.textures.of[faces[:, 0]]
    if base:
        shown[-1] = base.of[order[:, 0] // 3]
    facts = {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "low": low.tolist(),
        "step": step.tolist(),
        "bakes": described,
        "draws": _runs(shown),
        "base": base and base.put(columns, like),
        "differenceShown": _scale_end(np.abs(bakes[-1].w - bakes[0].w)),
        "columns": [[name, column.itemsize, column.size] for name, column in columns.items()],
    }
    planes = [np.ascontiguousarray(column).reshape(-1, 1).view(np.uint8).T.tobytes() for column in columns.values()]
    return facts, gzip.compress(b"".join(planes), 9, mtime=0)


def _bake_columns(bake: Values, number: int, columns: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """Write the values of a bake into the columns; returns what a page's script must know of them."""
    largest = 0.0 if bake.error is None else float(bake.error.max(initial=0.0))
    columns[f"w{number}"] = np.rint(bake.w * MOST).astype("<u2")
    if bake.error is not None:
        columns[f"error{number}"] = np.rint(255 * np.sqrt(bake.error / (largest or 1.0))).astype("u1")
    if bake.flags is not None:
        columns[f"flags{number}"] = bake.flags.astype("u1")
    if bake.bent_normals is not None:
        columns[f"bent{number}"] = _octahedral(bake.bent_normals, 255).astype("u1")
    rmse = bake.rmse
    if rmse is None:
        rmse = 0.0 if bake.error is None else float(np.sqrt(np.mean(bake.error**2)))
    described: dict[str, Any] = {"name": bake.name, "warning": bake.warning, "rmse": rmse}
    described |= {"errorTop": largest, "errorShown": _scale_end(bake.error)}
    if bake.textures:
        return described | _texture_columns(bake.textures, number, columns)
    if bake.profile:
        return described | _profile_columns(bake.profile, number, columns) | {"permanent": bake.permanent}
    return described


def _profile_columns(profile: Profile, number: int, columns: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """Add a profile's codes to `columns`, as differences; returns what else a page's script must know of it."""
    codes = np.rint(255 * profile.values.T).astype(np.uint8)
    columns[f"profile{number}"] = np.diff(codes, axis=0, prepend=np.uint8(0))
    lengths = profile.half_distances
    steps = np.geomspace(lengths[0], lengths[-1], 1 + round(_STEPS * np.log2(lengths[-1] / lengths[0])))
    weights = [np.round(profile.weights(step), 5).tolist() for step in steps]
    return {"halfDistances": steps.tolist(), "weights": weights, "radius": profile.radius}


def _texture_columns(textures: TexturedW, number: int, columns: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """Write the textures of a bake into the columns; returns what a page's script must know of them."""
    steps, scale = uv_steps(textures.uv)
    columns[f"uv{number}"] = steps.astype("<u4")
    images = [shrunk(image, _LARGEST) for image in textures.images]
    for image_number, image in enumerate(images):
        columns[f"texels{number}.{image_number}"] = np.diff(image.ravel(), prepend=np.uint8(0))
    sizes = [{"width": image.shape[1], "height": image.shape[0]} for image in images]
    return {"textures": [size | {"wrap": wrap} for size, wrap in zip(sizes, textures.wraps, strict=True)], **scale}


def _runs(shown: Int64s) -> list[list[int]]:
    """Runs of faces with the same textures: their lengths and textures.

    Args: shown: (bakes + 1, m), by bake and of colour.
    """
    starts = np.flatnonzero((shown[:, 1:] != shown[:, :-1]).any(axis=0)) + 1
    ends = [0, *starts.tolist(), shown.shape[1]]
    return [[end - begin, *shown[:, begin].tolist()] for begin, end in pairwise(ends)]


def _sorted(faces: Int32s, image: Int64s | None) -> Int64s:
    """The corners (m, 3) of the faces (m, 3), turned to begin with their least vertex, and sorted: by `image` first."""
    least = np.argmin(faces, axis=1)
    corners = 3 * np.arange(len(faces))[:, None] + (least[:, None] + np.arange(3)) % 3
    order = np.lexsort([*faces.ravel()[corners].T[::-1], *(() if image is None else (image,))])
    return np.asarray(corners[order])


def _differences(faces: Int32s) -> Int32s:
    """Small numbers, (3, m), that compress well, in place of the vertices of `_sorted` faces (m, 3): by how much the
    lowest vertex grows from face to face, and how far the other two lie above it."""
    stored = faces.copy()
    stored[:, 1:] -= faces[:, :1]
    stored[1:, 0] = np.diff(faces[:, 0])  # modulo 2³² where another image begins
    return np.ascontiguousarray(stored.T)


def _octahedral(vectors: AnyFloats, most: int) -> Float64s:
    """Unit vectors (n, 3) as whole numbers (2, n) from 1 to `most`; 0, 0 where there is none.

    Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors".
    """
    unit = normalize(np.asarray(vectors, np.float64))
    x, y, z = (unit / np.maximum(np.abs(unit).sum(axis=1, keepdims=True), 1e-300)).T
    folded = np.where(z < 0, [(1 - np.abs(y)) * np.copysign(1, x), (1 - np.abs(x)) * np.copysign(1, y)], [x, y])
    return np.where(unit.any(axis=1), np.rint((folded + 1) / 2 * (most - 1)) + 1, 0)


def _scale_end(error: AnyFloats | None) -> float:
    """The upper end of the error's scale: the 99th percentile, rounded up to 1, 2 or 5 times a power of ten."""
    reached = 0.0 if error is None or not len(error) else float(np.quantile(error, 0.99))
    if reached < 1e-6:
        return 0.001
    power = 10.0 ** np.floor(np.log10(reached))
    return float(next(digit * power for digit in (1, 2, 5, 10) if digit * power >= reached * (1 - 1e-9)))
