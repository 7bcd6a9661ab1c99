"""Every careless or hostile mesh file is refused in one line, or is a mesh."""

import json
import os

import numpy as np
import pytest
from command import obscurance, refused
from gltf_files import GONE, HALVES, QUAD, TRIANGLE, Builder, change
from mesh_files import FACES, VERTICES, ascii_ply, ascii_stl, mistake, mixed_ply, off, ply, read, stl

from obscurance.raytrace.errors import MeshError
from obscurance.scenes.formats.load import load


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("m.ply", b"", "an empty file"),
        ("m.obj", b"", "content: expected a mesh, got an empty file"),
        ("m.obj", b"ply\nformat ascii 1.0\nelement vertex 3\n", "none, and no vertices: perhaps it is no OBJ"),
        ("m.blend", b"x", "; Blender writes .glb of it, got .blend"),
        ("m.STEP", b"x", "; FreeCAD writes .glb of it, got .STEP"),
        ("m.svg", b"<svg/>", "that of 3MF, Esri ASCII grid, COLLADA, GLB, glTF, OBJ, OFF, PLY, STL, GeoTIFF, VRM"),
        ("m.msh", b"no mesh", "content: expected a file that meshio reads as .msh, got "),
        (f"{'n' * 90}.inp", b"*ELEMENT, TYPE=S99\n", f"Couldn't read file {'n' * 90}.inp as abaqus"),
        ("m.dae", b"<COLLADA", "DAE file"),
        ("m.zae", b"PK\x03\x04 and no archive", "ZAE file"),
        ("m", b"x", "got none"),
        ("m.xyz", b"0 0 0\n", "ending"),
        ("m.ply", b"\x89PNG\r\n\x1a\n" + bytes(100), "PLY file, got no header of a PLY file"),
        ("m.glb", b"a text, not a GLB file", "GLB file"),
        ("m.gltf", b"[]", "content: expected an object"),
        ("m.gltf", b"[" * 100_000, "content: expected JSON of at most 100 levels, got more"),
        ("m.stl", b"\x89PNG\r\n\x1a\n" + bytes(100), "complete ASCII or binary STL"),
        ("m.off", b"\x89PNG\r\n\x1a\n" + bytes(100), "OFF file"),
        ("m.obj", b"\x89PNG\r\n\x1a\n" + bytes(100), "at least one triangle"),
        ("m.3mf", b"PK\x03\x04 and no archive", "3MF file"),
        ("m.3mf", b"text", "3MF file"),
        ("m.ply", b"x" + ply()[1:], "PLY file, got no header of a PLY file"),
        ("m.ply", ply(faces=np.empty((0, 3))), "at least one triangle, got none, and 7 points"),
        ("m.ply", ply(faces=FACES + 5), "indices from 0 to 6"),
        ("m.ply", ply(faces=FACES - 1), "indices from 0 to 6"),
        ("m.ply", ply(vertices=VERTICES * np.nan), "finite coordinates"),
        ("m.ply", ply(vertices=VERTICES + np.inf), "finite coordinates"),
        ("m.ply", ply().replace(b"vertex 7", b"vertex 99999999999999"), "m.ply: "),
        ("m.ply", ascii_ply().replace(b"vertex 7", b"vertex 99999999999999"), "m.ply: "),
        ("m.ply", ascii_ply().replace(b"face 3", b"face 99999999999999"), "99999999999999 rows, got an end"),
        ("m.ply", ply().replace(b"property float z\n", b""), "m.ply: "),
        ("m.ply", ply()[:-1], "element face: expected 3 rows, got an end before that"),
        ("m.ply", ply()[:250], "element vertex: expected 7 rows, got an end before that"),
        ("m.ply", mixed_ply()[:-1], "element face: expected 3 rows, got an end before that"),
        ("m.ply", mixed_ply().replace(b"face 3", b"face 99999999999"), "element face: expected 99999999999 rows"),
        ("m.off", off(faces=FACES + 5), "indices from 0 to 6"),
        ("m.off", off(faces=FACES - 1), "indices from 0 to 6"),
        ("m.off", off().replace(b"7 3 0", b"7 9 0"), "7 vertices and 9 faces"),
        ("m.stl", stl(np.empty((0, 3, 3))), "at least one triangle"),
        ("m.stl", stl(VERTICES[FACES])[:-1], "complete ASCII or binary STL"),
        ("m.stl", ascii_stl(("one", VERTICES[FACES]), ("two", VERTICES[FACES]))[:-20], "complete ASCII"),
        ("m.stl", ascii_stl(("one", VERTICES[FACES])).replace(b"endloop", b"vertex 1 2 3\nendloop", 1),
         "10 vertices in solid one"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(tmp_path, name, data, expected, capfd):
    assert expected in mistake(tmp_path, name, data)
    assert capfd.readouterr() == ("", "")


def test_the_librarys_log_stays_quiet(tmp_path, caplog):
    data = ascii_stl(("one", VERTICES[FACES])).replace(b"normal 0 0 0", b"normal none at all")
    assert len(read(tmp_path, "m.stl", data).mesh.faces) == 3
    assert caplog.records == []


def test_files_that_are_none(tmp_path):
    (tmp_path / "folder.ply").mkdir()
    os.mkfifo(tmp_path / "pipe.ply")
    for name, expected in {"missing.ply": "got none", "folder.ply": "a folder", "pipe.ply": "regular file"}.items():
        with pytest.raises(MeshError, match=expected):
            load(tmp_path / name)
    with pytest.raises(MeshError, match="too long"):
        load(tmp_path / ("n" * 300))


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    def refuse(*_arguments, **_options):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "m.ply").write_bytes(ply())
    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(MeshError, match=r"m\.ply: file: expected a readable file, got Permission denied"):
        load(tmp_path / "m.ply")


def sparse(count=2, kind=5121):
    """A table of a sparse accessor, its indices those of the quad's positions as bytes or the like."""
    return {"count": count, "indices": {"bufferView": 0, "componentType": kind}, "values": {"bufferView": 1}}


def compressed(name, kind):
    """What the compression `name` changes in a header, whose decoder fills buffers, views or accessors."""
    changes = {"extensionsUsed": [name], "extensionsRequired": [name]}
    if kind == "accessors":
        return {**changes, "accessors/0/bufferView": GONE}
    extension = {"fallback": True} if kind == "buffers" else {}
    return {**changes, f"{kind}/0/extensions": {name: extension}} | ({"buffers/0/uri": GONE} if extension else {})


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"accessors/0/count": 10**9}, "GLB file"),
        ({"accessors/0/count": 10**15}, "GLB file"),
        (
            {"accessors/0/count": -1},
            "accessors[0].count: expected a whole number, 0 or more, got -1",
        ),
        ({"accessors/0/count": 0}, "count of at least 1, got 0"),
        ({"accessors/0/bufferView": GONE}, "uncompressed values"),
        ({"accessors/0/sparse": {}}, "accessors[0].sparse.count: expected a value, got nothing"),
        ({"accessors/0/sparse": sparse(count=5)}, "GLB file"),
        (
            {"accessors/0/sparse": sparse(kind=5126)},
            "sparse.indices: expected whole numbers below 4",
        ),
        (
            {"accessors/0/sparse": sparse(count=8, kind=5123)},
            "sparse.indices: expected whole numbers below 4",
        ),
        (
            {"accessors/0/bufferView": GONE, "accessors/0/count": 10**9, "accessors/0/sparse": sparse()},
            "accessors[0]: expected a count that the file's bytes can hold, got 1000000000",
        ),
        (compressed("EXT_meshopt_compression", "bufferViews"), "uncompressed values, got EXT_meshopt_compression"),
        (compressed("KHR_meshopt_compression", "bufferViews"), "uncompressed values, got KHR_meshopt_compression"),
        (compressed("KHR_meshopt_compression", "buffers"), "buffers[0]: expected uncompressed values, got KHR_meshopt"),
        (compressed("KHR_draco_mesh_compression", "accessors"), "uncompressed values, got KHR_draco_mesh_compression"),
        ({"accessors/1/count": 5}, "indices: expected three for each triangle, got 5"),
        ({"meshes/0/primitives/0/indices": 99}, "GLB file"),
        ({"meshes/0/primitives/0/attributes/POSITION": GONE}, "GLB file"),
        ({"nodes/0/children": [0]}, "own ancestor"),
        ({"nodes/0/mesh": 7}, "GLB file"),
        ({"nodes/0/scale": [float("nan")] * 3}, "GLB file, got NaN, which is no number in JSON"),
        ({"scenes/0/nodes": [-1]}, "scenes[0].nodes[0]: expected"),
        ({"scenes/0/nodes": []}, "at least one triangle"),
        ({"nodes": 3}, "nodes: expected a list"),
        ({"asset": {"version": "1.0"}}, "glTF 2.0"),
        ({"asset": {"version": 0.8}, "scene": "default"}, "asset.version: expected glTF 2.0, got 0.8"),
        ({"buffers/0/byteLength": 10**9}, "1000000000 bytes"),
    ],
)
def test_gltf_mistakes(tmp_path, changes, expected):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    header = builder.gltf([{"mesh": 0}])
    (tmp_path / "m.bin").write_bytes(builder.binary)
    change(header, changes)
    message = mistake(tmp_path, "m.gltf", json.dumps(header).encode())
    assert expected.replace("GLB file", "GLTF file") in message


def test_indices_into_a_neighbour_are_refused(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 4]]), builder.primitive(TRIANGLE, [[0, 1, 2]]))
    assert "indices from 0 to 2" in mistake(tmp_path, "m.glb", builder.glb([{"mesh": 0, "name": "bad"}]))


LARGE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1e60 0\nvt 1 0\nvn 0 0 1e60\nvn 0 0 1\n"


@pytest.mark.parametrize("ending", ["glb", "ply", "obj", "html"])
def test_texture_coordinates_beyond_float32_are_refused(tmp_path, ending):
    (tmp_path / "m.obj").write_bytes(LARGE + b"f 1/1 2/2 3/2\n")
    refused(
        obscurance("bake", tmp_path / "m.obj", "-o", tmp_path / f"w.{ending}"), "texture coordinates: expected numbers"
    )


@pytest.mark.parametrize("ending", ["vtp", "ply", "glb"])
def test_normals_beyond_float32_are_shortened_without_a_word(tmp_path, ending):
    (tmp_path / "m.obj").write_bytes(LARGE + b"f 1//1 2//2 3//2\n")
    done = obscurance("bake", tmp_path / "m.obj", "-o", tmp_path / f"w.{ending}", "--samples", 8, "-q")
    assert (done.returncode, done.stderr) == (0, "")
