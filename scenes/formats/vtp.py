"""Obscurance as point data of a VTK file of polygons.

Format: VTK XML formats, PolyData, version 1.0; arrays inline, in base64 after their lengths.
"""

from base64 import b64encode
from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.ao import Bake

from ..geometry.attributes import float_normals
from .load import MeshFile

_TYPES = {"f4": "Float32", "f8": "Float64", "i8": "Int64", "u1": "UInt8"}
_HEADER = '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">'


def vtp(bake: Bake, mesh_file: MeshFile, _: object) -> bytes:
    """The vertices and polygons of the source with `obscurance`, float, and as far as they are known `error`, `flags`,
    `bent_normals` and `Normals`, the source's own."""
    mesh = mesh_file.mesh
    held = mesh_file.held
    columns: dict[str, tuple[npt.NDArray[Any] | None, str]] = {
        "obscurance": (bake.w, "f4"),
        "error": (bake.error, "f4"),
        "flags": (bake.flags, "u1"),
        "bent_normals": (bake.bent_normals, "f4"),
        "Normals": (None if mesh.normals is None else float_normals(mesh.normals), "f4"),
    }
    point_data = [_array(name, values, kind) for name, (values, kind) in columns.items() if values is not None]
    lines = [
        _HEADER,
        "<PolyData>",
        f'<Piece NumberOfPoints="{len(mesh.vertices)}" NumberOfPolys="{len(held.sizes)}">',
        '<PointData Scalars="obscurance">',
        *point_data,
        "</PointData>",
        "<Points>",
        _array("Points", mesh.vertices, "f8"),
        "</Points>",
        "<Polys>",
        _array("connectivity", held.corners, "i8"),
        _array("offsets", np.cumsum(held.sizes), "i8"),
        "</Polys>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>\n",
    ]
    return "\n".join(lines).encode()


def _array(name: str, values: npt.NDArray[Any], kind: str) -> str:
    """A `DataArray` element of values, in base64 behind their number of bytes."""
    content = values.astype("<" + kind).tobytes()
    encoded = b64encode(len(content).to_bytes(8, "little") + content).decode()
    components = values.shape[1] if values.ndim > 1 else 1
    of_what = f'type="{_TYPES[kind]}" Name="{name}" NumberOfComponents="{components}"'
    return f'<DataArray {of_what} format="binary">{encoded}</DataArray>'
