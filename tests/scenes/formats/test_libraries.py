"""Formats that libraries read: COLLADA, and meshio's."""

import re
import subprocess
import sys

import meshio
import numpy as np
import pytest
from command import obscurance, refused
from fuzz_seeds import DAE, MODEL, archive
from mesh_files import obj

from obscurance.raytrace.errors import MeshError
from obscurance.scenes.formats.load import load, unit_of

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


SKIN = b"""<library_controllers><controller id="c"><skin source="#g"><bind_shape_matrix>1 0 0 3 0 1 0 0 0 0 1 0 0 0 0 1
</bind_shape_matrix><source id="j"><Name_array id="ja" count="1">bone</Name_array><technique_common>
<accessor source="#ja" count="1"><param name="JOINT" type="name"/></accessor></technique_common></source>
<source id="b"><float_array id="ba" count="16">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</float_array><technique_common>
<accessor source="#ba" count="1" stride="16"><param name="TRANSFORM" type="float4x4"/></accessor></technique_common>
</source>
<source id="w"><float_array id="wa" count="1">1</float_array><technique_common><accessor source="#wa" count="1">
<param name="WEIGHT" type="float"/></accessor></technique_common></source>
<joints><input semantic="JOINT" source="#j"/><input semantic="INV_BIND_MATRIX" source="#b"/></joints>
<vertex_weights count="5"><input semantic="JOINT" source="#j" offset="0"/>
<input semantic="WEIGHT" source="#w" offset="1"/>
<vcount>1 1 1 1 1</vcount><v>0 0 0 0 0 0 0 0 0 0</v></vertex_weights></skin></controller></library_controllers>"""
MORPH = b"""<library_controllers><controller id="c"><morph source="#g"><source id="t"><IDREF_array id="ta" count="1">g
</IDREF_array><technique_common><accessor source="#ta" count="1"><param name="T" type="IDREF"/></accessor>
</technique_common>
</source><source id="w"><float_array id="wa" count="1">0</float_array><technique_common>
<accessor source="#wa" count="1">
<param name="W" type="float"/></accessor></technique_common></source><targets>
<input semantic="MORPH_TARGET" source="#t"/>
<input semantic="MORPH_WEIGHT" source="#w"/></targets></morph></controller></library_controllers>"""


BOTH = MORPH.replace(b'"c"', b'"m"') + SKIN.replace(b'"#g"', b'"#m"')
CUT, NAMED = SKIN.replace(b"0 0</v>", b"9</v>"), MORPH.replace(b"IDREF_array", b"Name_array")


@pytest.mark.parametrize(
    ("controller", "moved", "said"),
    [(SKIN, 3, 0), (MORPH, 0, 0), (BOTH, 3, 1), (CUT, 3, 1), (NAMED, 0, 1)],
    ids=["skin", "morph", "skin of a morph", "malformed skin", "malformed morph"],
)
def test_collada_keeps_what_is_skinned_or_morphed(tmp_path, controller, moved, said):
    """The first node shows the geometry by a controller, as stored, whatever is malformed in that."""
    shown = b'<instance_geometry url="#g"/></node>\n<node><node>'
    content = DAE.replace(b"<library_visual_scenes>", controller + b"<library_visual_scenes>")
    content = content.replace(shown, shown.replace(b"instance_geometry", b"instance_controller").replace(b"#g", b"#c"))
    (tmp_path / "m.dae").write_bytes(content)
    file = load(tmp_path / "m.dae")
    assert file.objects == ("roof", "roof")
    assert len(file.notes) == said
    expected = np.concatenate([PLACES + np.array([moved, 0, 2]), 2 * PLACES])
    np.testing.assert_array_equal(file.mesh.vertices, expected)


def test_malformed_geometry_of_collada_is_told(tmp_path):
    (tmp_path / "m.dae").write_bytes(DAE.replace(b'url="#g"/></node>\n', b'url="#q"/></node>\n'))
    file = load(tmp_path / "m.dae")
    assert len(file.parts) == 1
    said = "m.dae: 1 parts of the document are malformed and left out: Geometry #q not found in library"
    assert [note.removeprefix(f"{tmp_path}/") for note in file.notes] == [said]


def test_slices_of_3mf_are_left_out(tmp_path):
    slices = b"""<s:slicestack id="9" 
xmlns:s="http://schemas.microsoft.com/3dmanufacturing/slice/2015/07"><s:slice ztop="1">
<s:vertices><s:vertex x="0" y="0"/><s:vertex x="1" y="0"/></s:vertices><s:polygon startv="0"><s:segment v2="1"/>
</s:polygon>
</s:slice></s:slicestack>"""
    for name, content in (("plain", MODEL), ("sliced", MODEL.replace(b"<resources>", b"<resources>" + slices))):
        (tmp_path / f"{name}.3mf").write_bytes(archive(**{"3D/3dmodel.model": content}))
    plain, sliced = (load(tmp_path / f"{name}.3mf") for name in ("plain", "sliced"))
    np.testing.assert_array_equal(plain.mesh.vertices, sliced.mesh.vertices)
    np.testing.assert_array_equal(plain.mesh.faces, sliced.mesh.faces)
    assert plain.notes == ()
    assert sliced.notes == (f"{tmp_path / 'sliced.3mf'}: what the 3MF extension slice adds is not read",)


def test_the_root_model_of_3mf_is_what_relations_say(tmp_path):
    kind = "http://schemas.microsoft.com/3dmanufacturing/2013/01/"
    links = f'<Relationship Target="/3D/3dmodel.model" Id="a" Type="{kind}thumbnail"/>'
    links += f'<Relationship Target="/3D/Other.custom" Id="b" Type="{kind}3dmodel"/>'
    relations = f"<Relationships xmlns='urn:r'>{links}</Relationships>".encode()
    unbuilt = re.sub(b"<build>.*</build>", b"<build/>", MODEL.replace(b"millimeter", b"inch"), flags=re.DOTALL)
    members = {"_rels/.rels": relations, "3D/3dmodel.model": unbuilt, "3D/Other.custom": MODEL}
    path = tmp_path / "m.3mf"
    path.write_bytes(archive(**members))
    assert len(load(path).mesh.faces)
    assert unit_of(path) == 0.001
    path.write_bytes(archive(**{**members, "_rels/.rels": relations.replace(b"Other", b"Gone")}))
    assert unit_of(path) == 0.0254
    path.write_bytes(archive(**{"a.txt": b"x"}))
    with pytest.raises(MeshError, match="complete and valid 3MF file, got no model"):
        load(path)


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


def test_a_mesh_of_mujoco_is_told_from_one_of_gmsh(tmp_path):
    counts, triangle = np.array([5, 0, 0, 1], "<i4"), np.array([0, 1, 4], "<i4")
    (tmp_path / "m.msh").write_bytes(counts.tobytes() + PLACES.astype("<f4").tobytes() + triangle.tobytes())
    refused(obscurance("info", tmp_path / "m.msh"), "expected a mesh of Gmsh or Ansys", "got MuJoCo's own .msh")


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
    refused(obscurance("info", tmp_path / f"m.{ending}"), "ending: expected that of", f"got .{ending}")


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
    ("name", "library", "packages"),
    [("m.dae", "collada", "lxml pycollada"), ("m.3mf", "lxml", "lxml pycollada"), ("m.asc", "rasterio", "rasterio")],
)
def test_without_its_library_a_format_is_refused_with_the_packages_that_bring_it(
    tmp_path, monkeypatch, name, library, packages
):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_bytes(DAE if library == "collada" else archive(**{"3D/3dmodel.model": b"<model/>"}))
    done = obscurance("info", tmp_path / name)
    expected = f"{library}, to read it: `python -m pip install {packages}`, got no {library}"
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
