"""Formats that libraries read: COLLADA, and meshio's."""

import subprocess
import sys

import meshio
import numpy as np
import pytest
from command import obscurance, refused
from fuzz_seeds import DAE, archive
from mesh_files import obj

from obscurance.scenes.formats.load import load

PLACES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])


@pytest.mark.parametrize("ending", ["dae", "zae"])
def test_collada_keeps_its_vertices_and_nodes(tmp_path, ending):
    path = tmp_path / f"m.{ending}"
    path.write_bytes(DAE if ending == "dae" else archive(**{"m.dae": DAE}))
    file = load(path)
    assert file.objects == ("roof", "roof")
    np.testing.assert_array_equal(file.mesh.vertices, np.concatenate([PLACES + np.array([0, 0, 2]), 2 * PLACES]))
    first = [[3, 2, 1], [3, 1, 0], [0, 1, 4], [1, 2, 4]]
    np.testing.assert_array_equal(file.mesh.faces, np.concatenate([first, np.add(first, 5)]))


def test_a_gmsh_file_is_read_without_a_word(tmp_path):
    cells = [("triangle", [[0, 1, 4]]), ("quad", [[0, 3, 2, 1]]), ("tetra", [[0, 1, 2, 4]])]
    meshio.Mesh(PLACES, cells).write(tmp_path / "m.msh")
    done = obscurance("bake", tmp_path / "m.msh", "-o", tmp_path / "m.npy", "--samples", 8)
    assert (done.returncode, done.stderr) == (
        0, f"warning: {tmp_path}/m.msh: tetra cells are left out: only triangles and quads are read\n"
    )  # fmt: skip
    np.testing.assert_array_equal(load(tmp_path / "m.msh").mesh.faces, [[0, 1, 4], [0, 3, 2], [0, 2, 1]])
    content = (tmp_path / "m.msh").read_bytes()
    np.testing.assert_array_equal(load("m.msh", content=content).mesh.vertices, PLACES)


@pytest.mark.parametrize("keyword", ["*INCLUDE", " *Include"])
def test_a_file_of_abaqus_includes_no_other(tmp_path, keyword):
    meshio.Mesh(PLACES, [("triangle", [[0, 1, 4]])]).write(tmp_path / "whole.inp")
    assert len(load(tmp_path / "whole.inp").mesh.faces) == 1
    (tmp_path / "m.inp").write_text(f"{keyword}, INPUT={tmp_path}/whole.inp\n")
    refused(obscurance("info", tmp_path / "m.inp"), "expected all of the mesh in one file, got *INCLUDE")


@pytest.mark.parametrize("ending", ["xdmf", "xmf", "cgns", "e", "exo", "h5m", "hmf", "med"])
def test_formats_that_name_files_anywhere_are_not_read(tmp_path, ending):
    """XDMF names files of numbers; HDF5 has external links and external raw storage."""
    (tmp_path / f"m.{ending}").write_text("<Xdmf/>")
    refused(obscurance("info", tmp_path / f"m.{ending}"), "ending: expected one of", f"got .{ending}")


def test_an_ending_is_refused_without_importing_a_library(tmp_path):
    (tmp_path / "m.svg").write_text("<svg/>")
    code = """
import sys
from obscurance.raytrace.errors import KernelError
from obscurance.raytrace.kernel import jit, library
from obscurance.raytrace.text import survey
from obscurance.scenes.formats.load import load
try:
    load(sys.argv[1])
except ValueError as error:
    print(str(error)[-8:], {"meshio", "trimesh", "collada"} & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "m.svg"], capture_output=True, text=True, check=True)
    assert done.stdout == "got .svg set()\n"


@pytest.mark.parametrize(
    ("name", "library", "extra"),
    [("m.dae", "collada", "formats"), ("m.3mf", "lxml", "formats"), ("m.asc", "rasterio", "terrain")],
)
def test_without_its_library_a_format_is_refused_with_the_extra_that_brings_it(
    tmp_path, monkeypatch, name, library, extra
):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_bytes(DAE if library == "collada" else archive(**{"3D/3dmodel.model": b"<model/>"}))
    done = obscurance("info", tmp_path / name)
    expected = f"{library}, to read it: `python -m pip install 'obscurance[{extra}]'`, got no {library}"
    assert (done.returncode, done.stderr) == (2, f"obscurance: {tmp_path}/{name}: format: expected {expected}\n")


def test_missing_kernels_are_no_fault_of_the_file(tmp_path):
    (tmp_path / "m.obj").write_bytes(obj())
    code = """
import sys
sys.modules["numba"] = None
from obscurance.raytrace.errors import KernelError
from obscurance.raytrace.kernel import library
library.find = lambda *_: None
from obscurance.scenes.formats.load import load
try:
    load(sys.argv[1])
except KernelError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "m.obj"], capture_output=True, text=True, check=True)
    assert "obscurance.raytrace.text.survey" in done.stdout
