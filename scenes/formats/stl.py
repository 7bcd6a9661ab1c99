"""STL, binary and text (3D Systems, StereoLithography interface specification, 1989): three own vertices a triangle.

An own reader because no count of a header is to be trusted, and memory stays bounded: estimated at 6 times the bytes of
a file, where what trimesh reads takes 22 times (evidence/reliability.md).
"""

import re
from pathlib import Path

import numpy as np

from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.normals import face_normals
from obscurance.raytrace.types import AnyInts, Float64s

from ..asset.asset import Asset
from ..asset.primitive import Primitive
from .number_rows import NumberRows
from .table import MeshInput

_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
"""A triangle of a binary STL."""
_ROUNDED = 1e-6  # of a mesh's extent, by which a written vertex may move
_NAME = re.compile(rb"solid([^\r\n]*)", re.IGNORECASE)


def read_stl(mesh_input: MeshInput) -> Asset:
    """The triangles; the solids of a text file one by one. The stored face normals are not read.

    A file is binary if it has the size that a binary header announces. Raises: MeshError, ValueError: it is no STL.
    """
    data = mesh_input.file.read()
    unread: tuple[str, ...] = ()
    announced = int.from_bytes(data[80:_HEADER], "little")
    if len(data) == _HEADER + announced * _TRIANGLE.itemsize:
        table = np.frombuffer(data, _TRIANGLE, announced, _HEADER)
        solids = [("", table["vertices"].reshape(-1, 3))]
        unread = ("attributes of triangles, as colours are stored",) if table["attribute"].any() else ()
    else:
        solids = _solids(data, mesh_input.source)
    for name, vertices in solids:
        if len(vertices) % 3:
            got = f"{len(vertices):,} vertices in solid {name or mesh_input.name}"
            raise MeshError(mesh_input.source, "facets", "three vertices in each", got)
    names = [name for name, _ in solids] if len(solids) > 1 else [mesh_input.name]
    primitives = [Primitive.of(vertices, np.arange(len(vertices))) for _, vertices in solids]
    return Asset.several(mesh_input.path, names, primitives, up="z", unread=unread)


def _solids(data: bytes, source: str) -> list[tuple[str, np.ndarray]]:
    """Name and vertices (n, 3) of each solid that has some."""
    lines = NumberRows.of(data)
    solid = lines.starting_with(b"solid")
    vertex = lines.starting_with(b"vertex")
    end = lines.starting_with(b"endsolid")
    damaged = MeshError(source, "content", "complete ASCII or binary STL", "neither: damaged or cut off")
    if len(solid) != len(end):
        raise damaged
    # Vertices must lie between a `solid` and its `endsolid`, each with three numbers.
    marks = np.stack([solid, end], axis=1).ravel()
    splits = np.searchsorted(vertex, marks)
    outside = np.diff(splits, prepend=0, append=len(vertex))[::2]
    if (np.diff(marks) < 0).any() or outside.any() or (lines.lengths[vertex] != 4).any():
        raise damaged
    numbers = lines.take(vertex, 1, 3, damaged).reshape(-1, 3)
    names = [next(_NAME.finditer(lines.data, word))[1] for word in lines.words(lines.bounds[solid]).tolist()]
    parts = zip(names, np.split(numbers, splits)[1::2], strict=True)
    solids = [(name.decode("utf-8", "replace").strip(), part) for name, part in parts if len(part)]
    if not solids:
        raise damaged
    return solids


def stl(vertices: Float64s, faces: AnyInts, output: Path) -> bytes:
    """The triangles as a binary STL. Raises: OptionError: float32 moves vertices by a millionth of their extent."""
    with np.errstate(over="ignore"):
        rounded = vertices.astype("<f4")
    moved = np.abs(rounded - vertices).max()
    if moved > _ROUNDED * np.ptp(vertices, axis=0).max():
        raise OptionError(
            "output", "a .ply, .obj or .off, for .stl has float32", f"{output}: vertices move by {moved:.3g}"
        )
    table = np.zeros(len(faces), _TRIANGLE)
    table["normal"] = face_normals(vertices, faces)[0]
    table["vertices"] = rounded[faces]
    return bytes(80) + len(faces).to_bytes(4, "little") + table.tobytes()


FORMATS = (
    {
        "ending": ".stl",
        "name": "STL",
        "read": "obscurance.scenes.formats.stl:read_stl",
        "peak": 6.0,
        "begins": rb"\s*solid\b.*\n\s*facet\b",
    },
)
