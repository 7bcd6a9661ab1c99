"""Mesh formats that meshio reads."""

import contextlib
import io
import re
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from obscurance.raytrace.errors import MeshError

from ..asset.asset import Asset
from ..asset.primitive import Primitive
from .table import MeshInput

_MESHIO = (  # not those by HDF5 and XDMF, which read any file that the content names
    "avs", "bdf", "dat", "dato", "ele", "f3grid", "fem", "inp", "mdpa", "mesh", "meshb", "msh", "nas", "node", "post",
    "su2", "tec", "ugrid", "vol", "vtk", "vtu", "wkt", "xml",
)  # fmt: skip
_SURFACES = ("triangle", "quad")


def library_endings() -> tuple[str, ...]:
    """Endings of files that `read_by_library` takes here; no library is imported."""
    return tuple(f".{ending}" for ending in _MESHIO if find_spec("meshio"))


def read_by_library(mesh_input: MeshInput) -> Asset:
    """The placed objects of a file with one of `library_endings`. Raises: Exception: what meshio raises."""
    path = mesh_input.path
    if mesh_input.is_on_disk:
        return _meshio(path, path)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"mesh{path.suffix.lower()}"
        copy.write_bytes(mesh_input.file.read())
        return _meshio(copy, path)


def _meshio(file: Path, path: Path) -> Asset:
    """Triangles and quads. meshio prints what each of its readers has to say, and ends the process if none can."""
    import meshio

    if path.suffix.lower() == ".inp" and _includes(file):
        raise MeshError(path, "content", "all of the mesh in one file", "*INCLUDE")
    if path.suffix.lower() == ".msh" and _is_mujoco(file):
        expected = "a mesh of Gmsh or Ansys, or one of MuJoCo in its other formats, .obj and .stl"
        raise MeshError(path, "content", expected, "MuJoCo's own .msh")
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        try:
            content = meshio.read(file)
        except SystemExit:
            name = r"\s*".join(map(re.escape, str(file)))  # which meshio breaks into lines
            reason = re.sub(name, path.name.replace("\\", r"\\"), " ".join(output.getvalue().split())) or "another"
            raise MeshError(path, "content", f"a file that meshio reads as {path.suffix}", reason) from None
    blocks = [block for block in content.cells if block.type in _SURFACES]
    corners = np.concatenate([np.empty(0, np.int64), *(np.ravel(block.data) for block in blocks)]).astype(np.int64)
    sizes = np.concatenate([np.empty(0, np.int64), *(np.full(*np.shape(block.data)) for block in blocks)])
    primitive = Primitive.of(content.points, corners, sizes, str(path))
    other_types = sorted({block.type for block in content.cells} - {*_SURFACES, "vertex", "line"})
    left_out = (
        (f"{', '.join(other_types)} cells are left out: only triangles and quads are read",) if other_types else ()
    )
    return Asset.single(path, path.stem, primitive, left_out)


def _includes(file: Path) -> bool:
    """Whether a file of Abaqus has the keyword by which it includes any other."""
    with file.open(errors="replace") as lines:
        return any(line.partition(",")[0].strip().replace("*", "").upper() == "INCLUDE" for line in lines)


def _is_mujoco(file: Path) -> bool:
    """Whether a file is as long as the four counts at its beginning say: of vertices, normals, texture coordinates and
    triangles (MuJoCo's XML reference, mesh)."""
    with file.open("rb") as content:
        counts = np.frombuffer(content.read(16).ljust(16), "<i4")
    return 16 + 4 * int(counts @ np.array([3, 3, 2, 3])) == file.stat().st_size
