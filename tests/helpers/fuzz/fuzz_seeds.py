"""Valid files of every format that is read, small and rich, for the fuzzer to spoil."""

import base64
import io
import json
import zipfile
from functools import cache

import numpy as np
import OpenImageIO as oiio
import PIL.Image
from gltf_files import HALVES, QUAD, TRIANGLE, Builder
from mesh_files import FACES, NORMALS, VERTICES, ascii_ply, ascii_stl, mixed_ply, obj, off, ply, rich_ply, stl
from vtp_files import COMPRESSORS, FORMS, Writer

OBJ = b"""\
mtllib square.mtl
o first
v 0 0 0 1 0 0
v 1 0 0 # right
v 1 1 0
v 0 1 .25
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
usemtl paint
g a
s 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 -2/-1/1 \\
  -1/3/1
l 1 2
f 1//1 2//1 3//1 4//1
"""
MTL = b"newmtl paint\nKd 1 0 0\nmap_Kd ../secret.png\n"
MATERIALS = b"""newmtl paint
Kd .1 .2 .3
Ke 0 1 0
Ks .5 .5 .5
Ns 30
Pm .5
Pr .4
Tr .25
map_Kd -s 1 1 1 paint.png
map_d paint.png
bump paint.png
"""
UV = VERTICES[:, :2]
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
SIDES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]

TOML = {
    "background": [0.05, 0.05, 0.06],
    "camera": {"position": [3.0, -6.0, 2.5], "target": [0.0, 0.0, 0.6], "field_of_view": 30.0, "aperture": 0.01},
    "render": {"width": 8, "height": 6, "samples": 2, "shading": "gouraud", "crop": [0, 0, 4, 4], "seed": 3},
    "obscurance": {"form": "ambient", "half_distance": "20%", "max_distance": "inf", "samples": 4},
    "materials": [
        {"name": "glaze", "model": "cook_torrance", "albedo": [0.1, 0.25, 0.5], "k_s": 0.3, "m": 0.15},
        {"name": "lines", "model": "poulin_fournier", "k_d": 0.2, "k_s": 0.5, "spacing": 1.5, "floor": 0.3},
        {"name": "cloth", "model": "oren_nayar", "albedo": 0.5, "sigma": 0.3},
        {"name": "other", "preset": "gold"},
        {"name": "a", "model": "ward", "k_d": 0.2, "k_s": [0.1, 0.2, 0.3], "m_parallel": 0.1, "m_perpendicular": 0.5},
        {"name": "plastic", "model": "phong", "k_d": 0.3, "k_s": 0.6, "exponent": 7, "two_sided": "viewer"},
        {"name": "silk", "model": "strauss", "colour": 0.5, "smoothness": 0.5},
        {"name": "b", "model": "ashikhmin_shirley", "albedo": 0, "exponent_parallel": 7, "exponent_perpendicular": 90},
        {"name": "c", "model": "kajiya", "height": 90, "correlation_parallel": 4e3, "correlation_perpendicular": 900},
    ],
    "objects": [
        {"mesh": "square.obj", "material": "glaze", "rotate": [90.0, 0.0, 0.0], "texture": "paint.png",
         "wrap": ["repeat", "clamp_to_edge"]},
        {"builtin": "plane", "size": [8.0, 8.0], "fineness": 2.0, "material": {"model": "lambert", "albedo": 0.5}},
        {
            "name": "pearl",
            "builtin": "sphere",
            "radius": 0.2,
            "fineness": 0.1,
            "material": "silver",
            "copies": [{"translate": [1.0, 0.5, 0.2]}, {"axis": [1, 0, 0], "angle": 30.0, "scale": [1.0, 1.0, 0.8]}],
        },
        {"mesh": "sub/quad.glb", "own_normals": False, "matrix": np.eye(4).tolist()},
        {"builtin": "sponge", "level": 1, "fineness": 0.5, "scale": 0.5},
    ],
    "lights": [
        {"light": "directional", "direction": [-0.5, 0.7, -0.8], "intensity": 2.5},
        {"light": "spot", "position": [-2.0, -2.0, 4.0], "direction": [2.0, 2.0, -4.0], "half_angle": 25.0,
         "exponent": 8.0, "intensity": [60.0, 55.0, 45.0], "range": 40.0},
        {"light": "point", "position": [0.0, 0.0, 4.0], "intensity": 3.0},
        {"light": "ambient", "intensity": 0.3},
        {"light": "sky", "zenith": [0.2, 0.3, 0.5], "horizon": 0.5, "ground": 0.1, "up": [0, 0, 1]},
        {"light": "environment", "image": "paint.png", "turn": 30.0},
    ],
}  # fmt: skip
BAKED = {
    "objects": [{"builtin": "plane", "fineness": 1.0}],
    "obscurance": {"baked": "w.npz"},
    "render": {"width": 4, "height": 4},
}


VARIANTS = {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}}


def quad_glb():
    return builder().glb(NODES, **EXTRAS)


def builder():
    """A mesh of two primitives, one with texture coordinates and a stride, and one of a skin and a morph target."""
    made = Builder()
    made.mesh(
        made.primitive(QUAD, HALVES, np.tile([0.0, 0.0, 1.0], (4, 1)), material=0),
        made.primitive(TETRAHEDRON, SIDES, material=1),
    )
    textured = made.primitive(TRIANGLE, material=2)
    textured["attributes"]["TEXCOORD_0"] = made.accessor(np.array([[0, 0], [1, 0], [0, 1]], "<f4"), "VEC2")
    made.header["bufferViews"][-1]["byteStride"] = 8
    made.mesh(textured, made.primitive(TETRAHEDRON, mode=5, extensions=VARIANTS), name="strip")
    posed = made.primitive(TRIANGLE, targets=[{"POSITION": made.accessor(TRIANGLE, "VEC3")}])
    posed["attributes"]["JOINTS_0"] = made.accessor(np.tile(np.array([0, 1, 0, 0], "u1"), (3, 1)), "VEC4")
    posed["attributes"]["WEIGHTS_0"] = made.accessor(np.tile(np.array([0.5, 0.5, 0, 0], "<f4"), (3, 1)), "VEC4")
    made.mesh(posed, weights=[0.5])
    made.accessor(np.tile(np.eye(4, dtype="<f4").ravel(), (2, 1)), "MAT4")
    rows, values = made.accessor(np.array([2], "<u2"), "SCALAR"), made.accessor(TRIANGLE[:1], "VEC3")
    indices, places = (made.header["accessors"][number]["bufferView"] for number in (rows, values))
    sparse = {"count": 1, "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": places}}
    made.header["accessors"][posed["attributes"]["POSITION"]]["sparse"] = sparse
    return made


NODES = [
    {"mesh": 0, "name": "quad", "children": [1, 2], "translation": [1, 2, 3]},
    {"mesh": 1, "rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, -1]},
    {"camera": 0, "matrix": np.eye(4).ravel().tolist(), "children": [3]},
    {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 0, 5]},
    {"mesh": 0, "name": "again"},
    {"mesh": 2, "skin": 0, "weights": [0.25]},
]
EXTRAS = {
    "scenes": [{"nodes": [0, 4, 5]}],
    "skins": [{"joints": [0, 1], "inverseBindMatrices": 12}],
    "materials": [
        {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.5], "metallicFactor": 0.5}, "alphaMode": "BLEND"},
        {"emissiveFactor": [1, 1, 0], "extensions": {"KHR_materials_unlit": {}}, "doubleSided": True},
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 0}, "roughnessFactor": 0.4},
            "occlusionTexture": {
                "index": 0,
                "strength": 0.5,
                "extensions": {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "texCoord": 0}},
            },
        },
    ],
    "textures": [{"source": 0, "sampler": 0}],
    "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9729}],
    "images": [{"uri": "paint.png"}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "zfar": 100}}],
    "extensions": {
        "KHR_lights_punctual": {
            "lights": [
                {"type": "spot", "intensity": 5, "range": 9, "spot": {"innerConeAngle": 0.1}, "color": [1, 1, 0]}
            ]
        }
    },
}


def gltf():
    """Header and the content of `m.bin`."""
    made = builder()
    header = made.header | {"nodes": NODES} | EXTRAS
    return header | {"buffers": [{"uri": "m.bin", "byteLength": len(made.binary)}]}, made.binary


def archive(**members):
    """A zip file."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return target.getvalue()


KINDS = {"bmp": "bmp", "hdr": "hdr", "targa": "tga", "webp": "webp", "sgi": "sgi", "dpx": "dpx", "pnm": "ppm",
         "iff": "iff", "fits": "fits", "ico": "ico", "rla": "rla", "jpegxl": "jxl"}  # fmt: skip
MODEL = b"""<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>
<object id="1" name="one" type="model"><mesh>
<vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/>
</vertices><triangles><triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/></triangles></mesh></object>
<object id="2" type="model"><components><component objectid="1"/>
<component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></components></object>
</resources>
<build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 2"/><item objectid="1"/></build>
</model>
"""
DAE = b"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g" name="roof"><mesh>
<source id="p"><float_array id="a" count="15">0 0 0 1 0 0 1 1 0 0 1 0 .5 .5 1</float_array>
<technique_common><accessor source="#a" count="5" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>3 2 1 0</p></polylist>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 4 1 2 4</p></triangles>
<lines count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1</p></lines>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>0 0 2</translate><instance_geometry url="#g"/></node>
<node><node><scale>2 2 2</scale><instance_geometry url="#g"/></node></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


@cache
def image(format_name, width=9, height=7, channels=3, kind="uint8", **attributes):
    """An image file's bytes."""
    folder = _folder()
    path = folder / f"seed.{format_name}"
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("DateTime", "2020:01:01 00:00:00")
    for name, value in attributes.items():
        spec.attribute(name, value)
    if attributes.get("tiled"):
        spec.tile_width = spec.tile_height = 16
    output = oiio.ImageOutput.create(format_name)
    assert output.open(str(path), spec), output.geterror()
    pixels = np.random.default_rng(0).integers(0, 256, (height, width, channels)).astype(np.uint8)
    assert output.write_image(pixels if kind == "uint8" else (pixels / 256).astype(np.float32)), output.geterror()
    output.close()
    content = path.read_bytes()
    path.unlink()
    # A DPX file holds its name and its hour.
    return content[:36] + bytes(124) + content[160:] if format_name == "dpx" else content


def gif():
    target = io.BytesIO()
    PIL.Image.fromarray(np.arange(200, dtype=np.uint8).reshape(10, 20)).save(target, "GIF")
    return target.getvalue()


@cache
def _folder():
    import tempfile
    from pathlib import Path

    return Path(tempfile.mkdtemp(prefix="fuzz-seeds-"))


def arrays(count=4):
    """w of that many vertices as .npy and .npz, and beside the vertices of a .ply."""
    plain, packed = io.BytesIO(), io.BytesIO()
    np.save(plain, np.full(count, 0.5, np.float32))
    np.savez_compressed(packed, w=np.full(count, 0.5), error=np.zeros(count))
    halves = np.full((count, 3), 0.5)
    mesh = ply(VERTICES[:count], [[0, 1, 3]], normals=halves).replace(b"float nx", b"float obscurance")
    return plain.getvalue(), packed.getvalue(), mesh


def companions():
    """What lies beside the file under test: name to content."""
    _, binary = gltf()
    npy, npz, _ = arrays()
    return {
        "square.obj": OBJ.replace(b"f 1//1 2//1 3//1 4//1\n", b""),
        "square.mtl": MTL,
        "paint.png": image("png"),
        "sub/paint.png": image("png"),
        "m.bin": binary,
        "sub/quad.glb": quad_glb(),
        "w.npy": npy,
        "w.npz": npz,
    }


def _embedded():
    return "data:image/png;base64," + base64.b64encode(image("png")).decode()


@cache
def seeds():
    """Family to its valid files, each a name and a content: bytes, or a JSON-like tree."""
    header, _ = gltf()
    many = np.random.default_rng(1).integers(0, 7, (300, 3))
    embedded = json.loads(json.dumps(header))
    return {
        "ply_ascii": [("m.ply", data) for data in (ascii_ply(), ascii_ply(faces=[[0, 1, 3, 4]]), _mixed_ascii())],
        "ply": [("m.ply", data) for data in (ply(), ply(order=">", normals=NORMALS), ply(faces=many, uv=UV))],
        "ply_mixed": [("m.ply", mixed_ply()), ("m.ply", mixed_ply(">")), ("m.ply", rich_ply())],
        "obj": [("m.obj", OBJ), ("m.obj", obj()), ("m.obj", obj(faces=many))],
        "stl": [("m.stl", stl(VERTICES[FACES])), ("m.stl", stl(VERTICES[many]))],
        "stl_ascii": [("m.stl", ascii_stl(("a", VERTICES[FACES]), ("b b", VERTICES[FACES])))],
        "off": [("m.off", off()), ("m.off", off(faces=[[0, 1, 3, 4]]))],
        "glb": [("m.glb", quad_glb())],
        "gltf": [("m.gltf", header), ("m.gltf", embedded | {"images": [{"uri": _embedded()}]})],
        "3mf": [("m.3mf", archive(**{"3D/3dmodel.model": MODEL, "a.txt": b"x"}))],
        "toml": [("m.toml", TOML), ("m.toml", BAKED)],
        "png": [("m.png", image("png")), ("m.png", image("png", 40, 30, 4)), ("m.png", image("png", 9, 7, 1))],
        "jpeg": [("m.jpg", image("jpeg", 40, 30))],
        "exr": [
            ("m.exr", image("openexr", 20, 30, 4, "half")),
            ("m.exr", image("openexr", 40, 30, 3, "float", tiled=1)),
        ],
        "tiff": [("m.tif", image("tiff", 20, 10, 3, "uint16")), ("m.tif", image("tiff", 40, 30, 4, "float", tiled=1))],
        "pictures": [*((f"m.{ending}", image(kind, 20, 10)) for kind, ending in KINDS.items()), ("m.gif", gif())],
        "vtp": [("m.vtp", Writer(form, by).document()) for form in FORMS for by in COMPRESSORS],
        "mtl": [("square.mtl", MTL), ("square.mtl", MATERIALS)],
        "array": [(f"w.{kind}", data) for kind, data in zip(("npy", "npz", "ply"), arrays(), strict=True)],
    }  # fmt: skip


def _mixed_ascii():
    return ascii_ply().replace(b"face 3", b"face 4") + b"5 0 1 5 3 4\n"
