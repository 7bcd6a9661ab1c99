"""What is kept of COLLADA, 3MF and STL besides triangles, and what outputs say that they cannot hold."""

import re

import numpy as np
from command import obscurance, refused, succeeded
from fuzz_seeds import DAE, FACES, MODEL, VERTICES, archive
from mesh_files import stl

from obscurance.scenes import load

NORMALS = """<source id="n"><float_array id="c" count="9">0 0 -1 0 -3 4 1 0 0</float_array><technique_common>
<accessor source="#c" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices"""
VERTEX, NORMAL = (
    '<input semantic="VERTEX" source="#v" offset="0"/>',
    '<input semantic="NORMAL" source="#n" offset="1"/>',
)


def with_normals(scale="2 2 2"):
    text = DAE.decode().replace("<vertices", NORMALS, 1).replace("<scale>2 2 2", f"<scale>{scale}")
    text = text.replace(
        f"{VERTEX}<vcount>4</vcount><p>3 2 1 0</p>", f"{VERTEX}{NORMAL}<vcount>4</vcount><p>3 0 2 0 1 0 0 0</p>"
    )
    return text.replace(f"{VERTEX}<p>0 1 4 1 2 4</p>", f"{VERTEX}{NORMAL}<p>0 1 1 1 4 1 1 2 2 2 4 2</p>").encode()


def test_normals_of_collada_stand_at_their_corners_in_every_place(tmp_path):
    for scale, mirrored in (("2 2 2", 1), ("-2 2 2", -1), ("2 4 2", 0)):
        (tmp_path / "m.dae").write_bytes(with_normals(scale))
        file = load(tmp_path / "m.dae")
        values, of = file.mesh.corner_normals
        normals = values[of] / np.linalg.norm(values[of], axis=2, keepdims=True)
        slope = np.array([0, -0.6, 0.8])
        expected = np.repeat([[0, 0, -1], [0, 0, -1], slope, [1, 0, 0]], 3, axis=0).reshape(4, 3, 3)
        np.testing.assert_allclose(normals[:4], expected, atol=1e-12)
        placed = expected * [mirrored or 1, 1, 1]
        if not mirrored:  # by the inverse transpose, (0, -3/4, 4/2)
            placed[2] = np.array([0, -0.75, 2]) / np.hypot(0.75, 2)
        np.testing.assert_allclose(normals[4:], placed, atol=1e-12)
    succeeded("bake", tmp_path / "m.dae", "-o", tmp_path / "w.obj", "--samples", 4)
    again = load(tmp_path / "w.obj").mesh.corner_normals
    np.testing.assert_array_equal(again.values[again.of], values[of])


def test_what_outputs_cannot_hold_is_told(tmp_path):
    model = MODEL.replace(b'unit="millimeter"', b"").replace(b"<model ", b'<model unit="inch" ', 1)
    camera = b'<library_cameras><camera id="k"><optics><technique_common><perspective><yfov>40</yfov><znear>1</znear>'
    camera += b"<zfar>9</zfar></perspective></technique_common></optics></camera></library_cameras><library_geometries>"
    collada = DAE.replace(b"<library_geometries>", camera).replace(b"<up_axis>", b'<unit meter="0.01"/><up_axis>')
    packed = bytearray(stl(VERTICES[FACES]))
    packed[84 + 48] = 7
    for name, content, words in (
        ("m.3mf", archive(**{"3D/3dmodel.model": model}), "its unit, 0.0254 m"),
        ("m.dae", collada, "cameras, its unit, 0.01 m"),
        ("m.stl", bytes(packed), "attributes of triangles, as colours are stored"),
    ):
        (tmp_path / name).write_bytes(content)
        done = succeeded("bake", tmp_path / name, "-o", tmp_path / "w.ply", "--samples", 4)
        assert f"not kept from {tmp_path / name}: " in done.stderr
        assert words in done.stderr
    assert load(tmp_path / "m.stl").unread
    packed[84 + 48] = 0
    (tmp_path / "m.stl").write_bytes(bytes(packed))
    assert not load(tmp_path / "m.stl").unread


def test_geometry_stays_whose_material_scene_or_camera_is_not_there(tmp_path):
    bound = """<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="red"
        target="#gone"/></technique_common></bind_material></instance_geometry>"""
    text = (
        DAE.decode()
        .replace('<instance_geometry url="#g"/>', bound, 1)
        .replace("<triangles", '<triangles material="red"')
    )
    scenes = "<library_visual_scenes>"
    library = text.replace(bound, '<instance_node url="#n"/>').replace(
        scenes, f'<library_nodes><node id="n">{bound}</node></library_nodes>{scenes}'
    )
    for content, line in (
        (text, "Material #gone not found"),
        (library, "Material #gone not found"),
        (
            DAE.decode().replace("</node>", '<instance_camera url="#gone"/></node>', 1),
            "Camera #gone not found in library",
        ),
        (re.sub("<scene>.*</scene>", "", DAE.decode()), ""),
    ):
        (tmp_path / "m.dae").write_text(content)
        file = load(tmp_path / "m.dae")
        assert len(file.mesh.faces) == 8
        assert bool(line) == bool(file.notes)
        assert all(line in note for note in file.notes)
    (tmp_path / "m.dae").write_text(DAE.decode().replace('"#g"', '"#gone"'))
    refused(obscurance("info", tmp_path / "m.dae"), "none, and 0 points; 2 parts of the document are malformed")
