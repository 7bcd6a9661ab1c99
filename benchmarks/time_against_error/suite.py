"""The meshes and falloffs that methods are compared on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.accuracy.dense_meshes import subdivided
from obscurance import ao
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.formats.load import load
from obscurance.scenes.geometry.builtin_shapes import Box, Cylinder, Sphere, menger, temple
from obscurance.scenes.geometry.polyhedra import icosphere
from obscurance.scenes.geometry.primitives import merge, plane

ENDINGS = (".obj", ".ply", ".stl", ".off")
LIMIT = 0.05  # of the diagonal
MANY = 500_000  # vertices of a dense mesh

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Specimen:
    """A mesh of the suite, made when its turn comes.

    Attributes:
        surface: of what it is a subdivision, see `subdivided`: specimens of one surface differ in density.
        dense: whether it is baked with the binary falloff only, to save time.
    """

    name: str
    make: Callable[[], Mesh]
    surface: str = ""
    dense: bool = False


def falloffs(mesh: Mesh, binary: bool = False) -> dict[str, ao.Falloff]:
    """Binary and, unless that is all, exponential; unlimited and limited to 5 % of the bounding box's diagonal."""
    reach = LIMIT * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    forms: dict[str, ao.Falloff] = {"binary": ao.Binary(), "binary 5%": ao.Binary(reach)}
    if not binary:
        forms |= {"exponential": ao.Exponential(), "exponential 5%": ao.Exponential(max_distance=reach)}
    return forms


def builtin(quick: bool) -> list[Specimen]:
    """Meshes that need no file, coarse to a million vertices; with `quick` three small ones."""
    few = [
        Specimen("pebble", lambda: stone(3)),
        Specimen("temple", lambda: temple(0.3 if quick else 0.14)),
        Specimen("stone", lambda: stone(5 if quick else 6), "stone"),
    ]
    if quick:
        return few
    return [
        *few,
        Specimen("solids", solids),
        Specimen("sponge", lambda: menger(2, 1.0, 6)),
        Specimen("stone ×4", lambda: subdivided(stone(6), 1), "stone", dense=True),
        Specimen("stone ×16", lambda: subdivided(stone(6), 2), "stone", dense=True),
        Specimen("coral", lambda: stone(8, octaves=6), dense=True),
        Specimen("plain", lambda: plain(1000), dense=True),
    ]


def from_folder(folder: Path, quick: bool) -> list[Specimen]:
    """The mesh files of `folder`, the largest also 4 and 16 times as dense; with `quick` the three smallest."""
    paths = sorted(
        (path for path in folder.iterdir() if path.suffix.lower() in ENDINGS), key=lambda p: p.stat().st_size
    )
    if quick or not paths:
        return [_file(path) for path in paths[:3]]
    largest = paths[-1]
    more = [
        Specimen(f"{largest.stem} ×{4**k}", lambda k=k: subdivided(load(largest).mesh, k), largest.stem, dense=True)
        for k in (1, 2)
    ]
    return [*(_file(path) for path in paths), *more]


def _file(path: Path) -> Specimen:
    return Specimen(path.stem, lambda: load(path).mesh, path.stem)


def stone(subdivisions: int, octaves: int = 5) -> Mesh:
    """A sphere of 10·4^subdivisions + 2 vertices, pushed in and out by waves of random directions, finer and finer."""
    directions, faces = icosphere(subdivisions)
    height = np.zeros(len(directions))
    for frequency, size in _waves(octaves):
        height += size * np.sin(directions @ frequency[:3] + frequency[3])
    return Mesh(directions * np.exp(height)[:, None], faces, source="stone")


def plain(cells: int) -> Mesh:
    """A square of (cells + 1)² vertices, hilly by the same waves."""
    flat = plane((-1, -1, 0), (2, 0, 0), (0, 2, 0), 2 / cells).mesh
    height = np.zeros(len(flat.vertices))
    for frequency, size in _waves(6):
        height += size * np.sin(flat.vertices @ frequency[:3] + frequency[3])
    return Mesh(flat.vertices + height[:, None] * [0, 0, 1], flat.faces, source="plain")


def _waves(octaves: int) -> Iterator[tuple[Floats, float]]:
    """Wave vectors and phases (4,), twelve an octave, and their heights."""
    chance = np.random.default_rng(3)
    for octave in range(octaves):
        for _ in range(12):
            direction = chance.normal(size=3)
            wave = direction / np.linalg.norm(direction) * 3.0 * 2**octave
            yield np.append(wave, chance.uniform(0, 2 * np.pi)), 0.12 / 1.9**octave


def solids() -> Mesh:
    """Boxes, spheres and cylinders crowded on a floor."""
    chance = np.random.default_rng(5)
    shapes = (Box(fineness=0.08), Sphere(fineness=0.08), Cylinder(fineness=0.08))
    pieces = [plane((-4, -4, 0), (8, 0, 0), (0, 8, 0), 0.08)]
    for number in range(24):
        piece = shapes[number % len(shapes)].geometry()
        place = np.append(chance.uniform(-3, 3, 2), 0.5 + 1e-3 * number)
        moved = Mesh(piece.mesh.vertices + place, piece.mesh.faces, piece.mesh.normals)
        pieces.append(type(piece)(moved, piece.uv))
    return merge(pieces, source="solids").mesh
