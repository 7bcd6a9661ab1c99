"""Baked textures as image files: their names, w, bent normals and errors; and the tiles of UDIM layouts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.system.atomic import PathName
from obscurance.raytrace.types import Float32s, Float64s

if TYPE_CHECKING:
    from obscurance.ao import Profile

PROFILE = "profile"  # the layer of an EXR
_MOST_TILES = 100
_ACROSS = 10  # tiles in a row of UDIM's numbers
ENDINGS = (".png", ".exr", ".tif", ".tiff")
PLACEHOLDERS = UDIM, MATERIAL, OBJECT = "<UDIM>", "<MATERIAL>", "<OBJECT>"
"""In the name of an output, of a tile's number and of names."""


def check_texture_target(option: str, path: Path, half: bool = False) -> None:
    """Find out before the bake whether an image can be written.

    Raises: OptionError: the ending is that of no image, or of one without floats for 16 bits. OutputError.
    """
    from obscurance.raytrace.image.formats import check_image_writable

    if not is_texture(path):
        raise OptionError(option, "a name ending in " + " ".join(ENDINGS), os.fspath(path))
    if half and path.suffix.lower() == ".png":
        raise OptionError("half", "images that end in .exr or .tif", os.fspath(path))
    check_image_writable(path)


def udim_tiles(uv: Float64s, source: object) -> list[tuple[int, int]]:
    """The UDIM tiles (column, row) that coordinates (m, 3, 2) reach into. Raises: OptionError: no number, or many."""
    from obscurance.ao.texture.uv_layout import tile_ranges

    low, high = tile_ranges(uv)
    corners = np.concatenate([low, high - 1])
    least = corners.min(axis=0)
    most = corners.max(axis=0)
    expected = f"texture coordinates of UDIM tiles: u from 0 to {_ACROSS}, v from 0 to {_MOST_TILES}"
    if least.min() < 0 or most[0] >= _ACROSS or most[1] >= _MOST_TILES:
        raise OptionError("output", expected, f"tiles {least.tolist()} to {most.tolist()}", source)
    rectangles = zip(low.tolist(), high.tolist(), strict=True)
    tiles = {tile for (u, v), (u_end, v_end) in rectangles for tile in product(range(u, u_end), range(v, v_end))}
    if len(tiles) > _MOST_TILES:
        raise OptionError("output", f"at most {_MOST_TILES} UDIM tiles", len(tiles), source)
    return sorted(tiles, key=lambda tile: tile[::-1])


def tile_number(tile: tuple[int, int]) -> str:
    """The number that replaces `UDIM` in the names of a tile's files."""
    return str(1001 + tile[0] + _ACROSS * tile[1])


def write_grey(
    path: Path,
    values: Float32s,
    half: bool,
    metadata: Mapping[str, str],
    bits: int = 16,
    profile: Profile | None = None,
) -> None:
    """Write w or its error (h, w), linear: PNG of 16 bits, or 8 dithered; EXR, with a profile as a layer, and TIFF."""
    from obscurance.raytrace.image.colour import dithered
    from obscurance.raytrace.image.write import write_data  # OpenImageIO's side, which names and checks do not need

    whole = values[:, :, None]
    layers: list[npt.NDArray[Any]] = [dithered(whole) if path.suffix.lower() == ".png" and bits == 8 else whole]
    names = ["Y"]
    if profile and path.suffix.lower() == ".exr":
        layers.append(profile.values)
        names += [f"{PROFILE}.{number:02}" for number in range(len(profile.half_distances))]
        lengths = profile.lengths
        lengths["half_distances"] = " ".join(map(repr, lengths["half_distances"]))
        metadata = {**metadata, **{name: str(value) for name, value in lengths.items()}}
    write_data(path, np.concatenate(layers, axis=2), metadata, half, names, bits)


def write_normals(path: Path, normals: Float32s, half: bool, metadata: Mapping[str, str], bits: int) -> None:
    """Write unit vectors (h, w, 3): n in files of floats, (n + 1)/2 in PNG. Raises: OutputError."""
    from obscurance.raytrace.image.write import write_data

    encoded = (normals + 1) / 2 if path.suffix.lower() == ".png" else normals
    write_data(path, encoded.astype(np.float32), metadata, half, "RGB", bits)


def is_texture(path: PathName) -> bool:
    """Whether a name is that of an image."""
    return Path(path).suffix.lower() in ENDINGS
