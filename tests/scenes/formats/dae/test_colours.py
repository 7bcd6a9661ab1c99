"""Materials of COLLADA and 3MF: their colours and pictures, in pictures, pages and .glb alike."""

import numpy as np
import pytest
from command import obscurance, succeeded
from fuzz_seeds import DAE, MODEL, archive
from kept_contents import bake, columns
from PIL import Image

from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.description.mesh_scene import read_mesh
from obscurance.scenes.formats.load import load
from obscurance.scenes.show.page.base_colour import base_colour

EFFECT = """<effect id="%s"><profile_COMMON>%s<technique sid="t"><phong><emission><color>0 0 0 1</color></emission>
<diffuse>%s</diffuse><specular><color>.5 .5 .5 1</color></specular><shininess><float>20</float></shininess>
</phong></technique></profile_COMMON></effect>"""
IMAGE = """<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>"""
LIBRARIES = f"""<library_images><image id="i"><init_from>skin.png</init_from></image></library_images>
<library_effects>{EFFECT % ("e", "", "<color>1 0 0 1</color>")}
{EFFECT % ("f", IMAGE, '<texture texture="p" texcoord="U"/>')}</library_effects>
<library_materials><material id="m" name="red"><instance_effect url="#e"/></material>
<material id="n" name="skin"><instance_effect url="#f"/></material></library_materials><library_geometries>"""
UV = """<source id="t"><float_array id="b" count="6">0 0 1 0 0 1</float_array><technique_common>
<accessor source="#b" count="3" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source><vertices"""
BOUND = """<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="A" target="#m"/>
<instance_material symbol="B" target="#n"/></technique_common></bind_material></instance_geometry>"""


def collada():
    """The seed with a red roof, and two of its triangles in a picture."""
    text = DAE.decode().replace("<library_geometries>", LIBRARIES).replace("<vertices", UV, 1)
    text = text.replace('<polylist count="1">', '<polylist count="1" material="A">')
    text = text.replace('<triangles count="2">', '<triangles count="2" material="B">')
    inputs = '<input semantic="VERTEX" source="#v" offset="0"/>'
    with_uv = '<input semantic="TEXCOORD" source="#t" offset="1" set="0"/><p>0 0 1 1 4 2 1 0 2 1 4 2</p>'
    text = text.replace(f"{inputs}<p>0 1 4 1 2 4</p>", inputs + with_uv)
    return text.replace('<instance_geometry url="#g"/>', BOUND).encode()


@pytest.fixture
def dae(tmp_path):
    Image.new("RGB", (4, 4), (0, 255, 0)).save(tmp_path / "skin.png")
    (tmp_path / "m.dae").write_bytes(collada())
    return tmp_path / "m.dae"


def material_of(asset):
    return [number for part in asset.parts for number in part.primitive.material.tolist()]


def painted():
    """The seed as a 3MF: a face of the object's red, the other of its own colour."""
    text = MODEL.decode().replace(
        "<resources>",
        '<resources><basematerials id="7"><base name="red" displaycolor="#FF0000"/></basematerials>'
        '<m:colorgroup xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" id="8">'
        '<m:color color="#00FF00"/><m:color color="#0000FF80"/></m:colorgroup>',
    )
    text = text.replace('<object id="1"', '<object id="1" pid="7" pindex="0"')
    return text.replace('v1="0" v2="1" v3="3"', 'v1="0" v2="1" v3="3" pid="8" p1="1"').encode()


def test_collada_has_materials_textures_and_coordinates(dae):
    kept = load(dae, "m.glb")
    assert [material.name for material in kept.materials] == ["red", "skin"]
    assert kept.materials[0].colour == (1, 0, 0)
    assert (kept.materials[0].specular, kept.materials[0].exponent) == ((0.5, 0.5, 0.5), 20)
    assert kept.materials[1].texture.texture.path == dae.parent / "skin.png"
    assert material_of(kept) == [0, 1, 1, 0, 1, 1]
    uv = kept.uv
    assert np.isnan(uv[[0, 1, 4, 5]]).all()
    assert uv[2].tolist() == uv[6].tolist() == [[0, 0], [1, 0], [0, 1]]


def test_a_picture_and_a_glb_of_collada_have_the_colours(dae, tmp_path):
    options = "--width", 48, "--height", 48, "--samples", 4, "--obscurance", "off"
    succeeded("render", dae, "-o", tmp_path / "p.exr", *options)
    beauty = read_image(tmp_path / "p.exr")[0]["beauty"].reshape(-1, 4)
    assert (beauty[:, 1] > 2 * beauty[:, 0]).any()
    succeeded("bake", dae, "-o", tmp_path / "m.glb", "--samples", 16)
    made = load(tmp_path / "m.glb").raw.header["materials"]
    assert {material.get("name") for material in made} >= {"red", "skin"}
    assert base_colour(load(dae, "page.html")).images


@pytest.mark.parametrize("name", ["a skin.png", "a%20skin.png"])
def test_a_picture_may_have_a_name_in_a_url(dae, name):
    (dae.parent / "skin.png").rename(dae.parent / name)
    dae.write_bytes(dae.read_bytes().replace(b"skin.png", b"./a%20skin.png"))
    assert load(dae, "m.glb").materials[1].texture.texture.path == dae.parent / name


def test_what_no_viewer_shows_is_left_out_in_a_line(dae, tmp_path):
    (tmp_path / "skin.png").unlink()
    done = obscurance("render", dae, "-o", tmp_path / "p.png", "--width", 8, "--height", 8, "--samples", 1)
    assert "m.dae: left out: texture of diffuse (skin.png)" in done.stderr


def test_faces_of_3mf_have_their_colours_in_every_copy(tmp_path):
    (tmp_path / "m.3mf").write_bytes(archive(**{"3D/3dmodel.model": painted()}))
    kept = load(tmp_path / "m.3mf", "m.glb")
    assert [material.colour for material in kept.materials] == [(1, 0, 0), (0, 0, 1)]
    assert material_of(kept) == [0, 1] * 3
    codes = base_colour(load(tmp_path / "m.3mf", "page.html")).codes
    np.testing.assert_array_equal(decode_srgb(codes[:2, 0] / 255), [(1, 0, 0), (0, 0, 1)])


def test_a_malformed_colour_of_3mf_is_left_out(tmp_path):
    content = painted().replace(b"#0000FF80", b"blue")
    (tmp_path / "m.3mf").write_bytes(archive(**{"3D/3dmodel.model": content}))
    file = load(tmp_path / "m.3mf", "m.glb")
    assert len(file.materials) == 1
    assert file.unread[1:] == ("colours of textures or mixtures, of very many kinds, or malformed",)


def test_an_object_of_a_scene_takes_the_coordinates_of_all_its_parts(dae):
    made, notes = read_mesh(dae, textured=True)
    assert made.uv is None  # the roof has none
    assert (len(made.mesh.faces), notes) == (8, [])


def test_mirrored_copies_have_their_coordinates_turned_over(dae):
    dae.write_bytes(dae.read_bytes().replace(b"<scale>2 2 2</scale>", b"<scale>-2 2 2</scale>"))
    file = load(dae, "m.glb")
    uv = file.uv
    assert uv[2].tolist() == uv[6, ::-1].tolist()
    corners = file.triangles.take(file.corners)
    np.testing.assert_array_equal(corners, file.mesh.faces)


COLOURS = b"""<source id="c"><float_array id="d" count="9">1 0 0 0 1 0 0 0 1</float_array><technique_common>
<accessor source="#d" count="3" stride="3"><param name="R" type="float"/><param name="G" type="float"/>
<param name="B" type="float"/></accessor></technique_common></source><vertices id="v">"""


def test_colours_of_vertices_of_collada_are_kept(tmp_path):
    """Of the triangles, which are left of the file."""
    head, _, rest = DAE.replace(b'<vertices id="v">', COLOURS).partition(b"<polylist")
    triangles = rest[rest.index(b"<triangles") :]
    coloured = b'<input semantic="COLOR" source="#c" offset="1"/><p>0 0 1 1 4 2 1 1 2 0 4 2</p>'
    (tmp_path / "m.dae").write_bytes(head + triangles.replace(b"<p>0 1 4 1 2 4</p>", coloured, 1))
    bake(tmp_path, "m.dae", "w.ply")
    vertex = columns(tmp_path / "w.ply")[0]["vertex"]
    found = np.stack([vertex[name].values for name in ("red", "green", "blue")], axis=-1)[:5]
    np.testing.assert_array_equal(found / 255, [[1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 1], [0, 0, 1]])
