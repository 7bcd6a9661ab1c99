"""w(p) as `obscurance bake` has stored it: in arrays, and in meshes beside their vertices."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError, OptionError, SceneError
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.image.texture import Texture, pack_textures
from obscurance.raytrace.image.texture_lookup import sample_points
from obscurance.raytrace.mesh.weld import first_alike
from obscurance.raytrace.system.atomic import PathName
from obscurance.raytrace.system.checks import check_regular
from obscurance.raytrace.types import AnyFloats, Float64s, Int64s

from ..asset.asset import Asset, Part
from ..asset.primitive import W
from .images import PROFILE
from .load import parser_errors, read_asset
from .table import endings, format_of, is_raster

ENDINGS = endings("w")
if TYPE_CHECKING:
    from obscurance.ao import Profile
    from obscurance.ao.falloff import Length

_ARRAYS = {"profile", "half_distances", "radius"}
_BESIDE = {"error": (), "flags": (), "bent_normals": (3,)}


class Scales(NamedTuple):
    """w as a product of powers of w at several half-distances: fine creases times large rooms."""

    half_distances: tuple[Length, ...]
    powers: tuple[float, ...]

    def of(self, profile: Profile) -> Float64s:
        """w (…,), in [0, 1]. Raises: OptionError: a half-distance is outside the profile."""
        pairs = zip(self.half_distances, self.powers, strict=True)
        return np.asarray(np.multiply.reduce([profile.at(length) ** power for length, power in pairs]))


def check_stored(path: Path) -> None:
    """Check that the name is that of an existing file of w. Raises: OptionError."""
    if path.suffix.lower() not in ENDINGS:
        raise OptionError("--baked", "a name ending in " + ", ".join(ENDINGS), path)
    if not path.is_file():
        raise OptionError("--baked", "an existing file", path)


def read_w(path: PathName, *counts: int, scales: Scales | None = None) -> Float64s:
    """w (n,): a `.npy` file, the array `w` of a `.npz` file, that of a mesh's vertices, or of a GeoTIFF's cells.

    Primitives of a glTF that a bake has left nothing in have what their occlusion texture is at the vertices.

    Args: counts: what n may be, by default anything: in a `.glb` also vertices that it repeats, after all others.
        scales: half-distances to look up in the file's profile, in place of its w.

    Raises: SceneError: the file cannot be read, or has none for so many vertices. OptionError: as `Scales.of`.
    """
    path = Path(path)
    try:
        if is_raster(path):
            w = _of_raster(path)
        elif format_of(path).read:
            w = w_of_mesh(read_asset(path), counts, scales)
        else:
            w = scales.of(checked_profile(path, find_profile(path))) if scales else _of_array(path, counts)
    except MeshError as fault:
        raise SceneError(fault.source, fault.field, fault.expected, fault.got) from None
    if counts and len(w) not in counts:
        raise _other_count(path, "w", counts, f"{len(w):,}")
    if not ((w >= 0) & (w <= 1)).all():
        raise SceneError(path, "w", "values in [0, 1]", "others")
    return w


def find_profile(path: Path) -> Profile | None:
    """The profile in a `.npz`, `.exr` or mesh file, or None. Raises: SceneError, MeshError: it cannot be read."""
    from obscurance.ao import Profile

    if path.suffix.lower() == ".npz":
        with _array_errors(path), path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            if set(arrays) >= _ARRAYS:
                limit = arrays["max_distance"][()] if "max_distance" in arrays else None
                return Profile.stored(arrays["half_distances"], arrays["profile"], arrays["radius"][()], limit)
    elif path.suffix.lower() == ".exr":
        layers, metadata = read_image(path)
        if PROFILE in layers:
            lengths = metadata.get("half_distances", "").split()
            return Profile.stored(lengths, layers[PROFILE], metadata.get("radius"), metadata.get("max_distance"))
    elif "profile" in format_of(path).holds:
        return read_asset(path, points=True).profile
    return None


def checked_profile(path: Path, profile: Profile | None) -> Profile:
    """The profile of a file. Raises: SceneError: it has none."""
    if profile is None:
        raise SceneError(path, "profile", "w at several half-distances, as obscurance bake --profile writes it", "none")
    return profile


def w_of_mesh(asset: Asset, counts: tuple[int, ...] = (), scales: Scales | None = None) -> Float64s:
    """w (n,) that a bake has left in a mesh file. Args, Raises: as `read_w`, but for values beyond [0, 1]."""
    path = asset.path
    with parser_errors(path):
        stored = [(part, _of_part(asset, part, scales)) for part in asset.parts]
    if any(w is None for _, w in stored):
        raise SceneError(path, "w", "obscurance at every vertex, as obscurance bake writes it", "none")
    if asset.is_scene and counts and asset.parts[-1].vertices.stop not in counts:
        stored = [(part, w) for part, w in stored if not part.is_flattened]  # pictures leave out what nodes flatten
    with np.errstate(invalid="ignore"):  # signalling NaNs, which are no w
        w = np.concatenate([np.empty(0), *(w for _, w in stored if w is not None)]).astype(np.float64)
    if len(stored) == 1 and asset.is_scene and len(w) not in counts:
        w = w[: unrepeated(stored[0][0].primitive.positions, counts)]
    return w


def _of_part(asset: Asset, part: Part, scales: Scales | None) -> AnyFloats | None:
    """w of a part's vertices: what a bake has left or, at the scales, its profile; else the occlusion texture there."""
    if scales:
        return scales.of(checked_profile(asset.path, part.primitive.profile))
    if W in part.primitive.columns:
        return part.primitive.columns[W].values
    of = part.primitive.material
    lookup = None if of is None or not len(of) else asset.material(int(of[0])).occlusion
    used = asset.looked_up(part.primitive, lookup)
    if lookup is None or used is None:
        return None
    (uv, _, _), texture = used
    linear = np.empty((len(uv), 3))
    sample_points(pack_textures([texture]), 0, uv, linear)
    w: Float64s = 1.0 + lookup.strength * (linear[:, 0] - 1.0)  # glTF 2.0, section 5.21
    return w


class FaceTextures(NamedTuple):
    """Textures by which w varies on faces.

    Attributes: uv: (m, 3, 2), v upwards, NaN where there are none. of: (m,), which texture a face has, −1 for none.
        textures: and their strengths.
    """

    uv: Float64s
    of: Int64s
    textures: list[tuple[Texture, float]]


def occlusion_textures(asset: Asset) -> FaceTextures | None:
    """The occlusion textures of a glTF but for ramps, None without any."""
    count = len(asset.mesh.faces)
    uv = np.full((count, 3, 2), np.nan)
    of = np.full(count, -1)
    numbers: dict[tuple[Texture, float], int] = {}
    for run in asset.runs() if asset.is_scene else ():
        part, lookup = asset.parts[run.part], asset.material(run.material.key).occlusion
        used = asset.looked_up(part.primitive, lookup)
        if lookup and used and not lookup.is_ramp:
            column, texture = used
            uv[run.faces] = column.values[part.primitive.rows(column)[run.faces - part.faces.start]]
            of[run.faces] = numbers.setdefault((texture, lookup.strength), len(numbers))
    return FaceTextures(uv, of, list(numbers)) if numbers else None


def _of_raster(path: Path) -> Float64s:
    """w (n,) that a bake has left in a raster, of the cells with data. Raises: SceneError: there is none."""
    from .raster import stored_columns

    with _array_errors(path):
        columns = stored_columns(path, ("w",))
    if "w" not in columns:
        raise SceneError(path, "w", "a band called obscurance, as obscurance bake writes it", "none")
    return columns["w"]


def _other_count(path: Path, name: str, counts: tuple[int, ...], got: str) -> SceneError:
    """The error for an array of another length. Args: counts: of vertices, of mesh files and of the scene."""
    expected = f"{counts[0]:,} values, one a vertex of the scene" if counts else "an array (n,), one value a vertex"
    if len(set(counts)) > 1:
        expected += f"'s files, or {counts[1]:,}, one a vertex of the scene"
    return SceneError(path, name, expected, got)


def unrepeated(vertices: npt.NDArray[Any], counts: tuple[int, ...]) -> int:
    """How many of the vertices (n, 3) of a .glb, which repeats some last, are the file's: one of `counts`, or n."""
    fewer = [count for count in counts if count < len(vertices)]
    alike = first_alike(np.ascontiguousarray(vertices)) if fewer else np.empty(0)
    return next((count for count in fewer if (alike[count:] < count).all()), len(vertices))


def read_beside_w(path: Path, count: int) -> dict[str, Any]:
    """`error`, `flags`, `bent_normals` of `count` vertices, as `.npz` and `.tif` have them. Raises: SceneError."""
    if is_raster(path):
        from .raster import stored_columns

        return dict[str, Any](stored_columns(path, _BESIDE))
    if path.suffix.lower() != ".npz":
        return {}
    with _array_errors(path), zipfile.ZipFile(path) as archive:
        held = {name for name in _BESIDE if f"{name}.npy" in archive.namelist()}
    return {name: _of_array(path, (count,), name, columns) for name, columns in _BESIDE.items() if name in held}


def _of_array(path: Path, counts: tuple[int, ...], name: str = "w", columns: tuple[int, ...] = ()) -> npt.NDArray[Any]:
    """The array of a `.npy` file, or of this name in a `.npz` file; only its header is read if that is another.

    Args: columns: its shape but for the first number, which is one of `counts`.
    """
    with _array_errors(path), ExitStack() as stack:
        if path.suffix.lower() == ".npz":
            archive = stack.enter_context(zipfile.ZipFile(path))
            file: IO[bytes] = stack.enter_context(archive.open(f"{name}.npy"))
        else:
            file = stack.enter_context(path.open("rb"))
        version = np.lib.format.read_magic(file)
        headers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, by_columns, kind = headers[version](file)
        if shape[1:] != columns or len(shape) != 1 + len(columns) or (counts and shape[0] not in counts):
            got = f"{shape[0]:,}" if len(shape) == 1 and not columns else f"shape {shape}"
            raise _other_count(path, name, counts, got)
        if kind.kind not in "fiu" or kind.itemsize > 16:
            raise SceneError(path, name, "numbers", kind)
        data = np.frombuffer(file.read(int(np.prod(shape)) * kind.itemsize), kind)
        return data.reshape(shape, order="F" if by_columns else "C").astype(np.float64)


@contextmanager
def _array_errors(path: Path) -> Iterator[None]:
    """Errors in reading a file of arrays, as `SceneError`."""
    check_regular(path, "a file of w", SceneError)
    with parser_errors(path, SceneError, "w as obscurance bake writes it"):
        yield
