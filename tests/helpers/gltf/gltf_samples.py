"""Valid glTF files of what materials and geometry can be, made by hand, for the tests."""

import base64
import io

import numpy as np
import PIL.Image
from gltf_files import HALVES, QUAD, TRIANGLE, Builder

UV = QUAD[:, :2].copy()
TEXTURED = {"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}


def encoded(codes):
    """The bytes of a PNG of codes (h, w, 3) or (h, w)."""
    file = io.BytesIO()
    PIL.Image.fromarray(codes).save(file, "PNG")
    return file.getvalue()


def picture(colour=(200, 120, 40)):
    """The bytes of a PNG of one colour."""
    return encoded(np.full((4, 4, 3), colour, np.uint8))


def with_images(builder, *images):
    """Fields of a document with a texture for each PNG."""
    entries = []
    for data in images:
        builder.header["bufferViews"].append({"buffer": 0, "byteOffset": len(builder.binary), "byteLength": len(data)})
        builder.binary += data + b"\0" * (-len(data) % 4)
        entries.append({"bufferView": len(builder.header["bufferViews"]) - 1, "mimeType": "image/png"})
    return {"images": entries, "textures": [{"source": number} for number in range(len(images))]}


def quad(builder, *sets, **fields):
    """A primitive of four vertices with so many sets of texture coordinates."""
    made = builder.primitive(QUAD, HALVES, **fields)
    for number in sets:
        made["attributes"][f"TEXCOORD_{number}"] = builder.accessor(UV, "VEC2")
    return made


def half_textured(codes, uv, **reference):
    """A square with an occlusion texture (h, w) of 8 bits by coordinates (4, 2), beside one whose vertices have w."""
    builder = Builder()
    pieces = [quad(builder, material=0), quad(builder, material=1)]
    pieces[0]["attributes"]["TEXCOORD_0"] = builder.accessor(np.asarray(uv, "<f4"), "VEC2")
    pieces[1]["attributes"]["_OBSCURANCE"] = builder.accessor(np.full(4, 0.25, "<f4"), "SCALAR")
    for piece in pieces:
        builder.mesh(piece)
    png = base64.b64encode(encoded(codes)).decode()
    fields = {
        "materials": [{"occlusionTexture": {"index": 0, **reference}}, {}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "images": [{"uri": f"data:image/png;base64,{png}"}],
    }
    return builder.glb([{"mesh": 0}, {"mesh": 1, "translation": [1, 0, 0]}], **fields)


def plain():
    builder = Builder()
    builder.mesh(quad(builder))
    return builder.glb([{"mesh": 0}])


def textured():
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0))
    return builder.glb([{"mesh": 0}], materials=[TEXTURED], **with_images(builder, picture()))


def shared_material():
    """A material of two meshes, of which one has texture coordinates, and a primitive without any material."""
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0), quad(builder))
    builder.mesh(quad(builder, material=0))
    return builder.glb([{"mesh": 0}, {"mesh": 1, "translation": [0, 0, 0.3]}], materials=[{"name": "matt"}])


def instances():
    """A mesh that three nodes place, and one that no scene shows."""
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0))
    nodes = [{"mesh": 0, "translation": [0, 0, 0.5 * n]} for n in range(3)]
    images = with_images(builder, picture())
    return builder.glb([*nodes, {"mesh": 0}], roots=[0, 1, 2], materials=[TEXTURED], **images)


def skinned():
    builder = Builder()
    primitive = quad(builder, 0)
    joints, weights = np.zeros((4, 4), np.uint8), np.tile(np.array([1, 0, 0, 0], "<f4"), (4, 1))
    primitive["attributes"]["JOINTS_0"] = builder.accessor(joints, "VEC4")
    primitive["attributes"]["WEIGHTS_0"] = builder.accessor(weights, "VEC4")
    builder.mesh(primitive)
    return builder.glb([{"mesh": 0, "skin": 0}, {"name": "bone"}, {"mesh": 0, "skin": 0}], skins=[{"joints": [1]}])


def morphed():
    builder = Builder()
    moved = (QUAD + np.array([0, 0, 1], "<f4")).astype("<f4")
    bounds = {"min": moved.min(axis=0).tolist(), "max": moved.max(axis=0).tolist()}
    targets = [{"POSITION": builder.accessor(moved, "VEC3", **bounds)}]
    builder.mesh(quad(builder, targets=targets), weights=[0.25])
    return builder.glb([{"mesh": 0}, {"mesh": 0, "weights": [0.5], "translation": [2, 0, 0]}])


def sparse(base=True):
    """The quad, of which the last vertex is given by itself, or of which the first is the zero of no buffer view."""
    builder = Builder()
    vertices = QUAD.copy()
    if base:
        vertices[3] = 9
    builder.mesh(builder.primitive(vertices, HALVES))
    accessor = builder.header["accessors"][0]
    accessor |= {"min": [0, 0, 0], "max": [1, 1, 0]}
    rows = [3] if base else [1, 2, 3]
    indices = builder.accessor(np.array(rows, "<u2"), "SCALAR")
    places = builder.accessor(QUAD[rows], "VEC3")
    del builder.header["accessors"][indices:]
    if not base:
        del accessor["bufferView"]
    views = len(builder.header["bufferViews"])
    accessor["sparse"] = {
        "count": len(rows),
        "indices": {"bufferView": views - 2, "componentType": 5123},
        "values": {"bufferView": views - 1},
    }
    assert places == indices + 1
    return builder.glb([{"mesh": 0}])


def sparse_without_base():
    return sparse(base=False)


def transformed():
    """Two sets, of which the colour takes the second, moved."""
    builder = Builder()
    builder.mesh(quad(builder, 0, 1, material=0))
    moved = {"offset": [0.5, 0], "rotation": 0.3, "scale": [2, 1], "texCoord": 1}
    colour = {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": moved}}
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": colour}}]
    used = {"extensionsUsed": ["KHR_texture_transform"]}
    return builder.glb([{"mesh": 0}], materials=materials, **used, **with_images(builder, picture()))


def variants():
    builder = Builder()
    mappings = {"mappings": [{"material": 1, "variants": [0]}]}
    builder.mesh(quad(builder, material=0, extensions={"KHR_materials_variants": mappings}), quad(builder, material=1))
    return builder.glb(
        [{"mesh": 0}],
        materials=[{"name": "day"}, {"name": "night"}],
        extensions={"KHR_materials_variants": {"variants": [{"name": "dark"}]}},
        extensionsUsed=["KHR_materials_variants"],
    )


def strip():
    builder = Builder()
    builder.mesh(builder.primitive(QUAD[[0, 1, 3, 2]], mode=5), builder.primitive(TRIANGLE))
    return builder.glb([{"mesh": 0}])


def occluded(strength=1.0):
    """A material with an occlusion texture of its own, and a primitive without."""
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0))
    builder.mesh(quad(builder, 0))
    materials = [{"name": "old", "occlusionTexture": {"index": 0, "strength": strength}}]
    nodes = [{"mesh": 0}, {"mesh": 1, "translation": [1.2, 0, 0]}]
    return builder.glb(nodes, materials=materials, **with_images(builder, picture((64, 200, 200))))


def rough():
    """A material with a metallic-roughness texture, and one without."""
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0), quad(builder, 0, material=1))
    surface = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}
    return builder.glb([{"mesh": 0}], materials=[surface, {}], **with_images(builder, picture()))


SAMPLES = {
    made.__name__: made
    for made in (
        *(plain, textured, shared_material, instances, skinned, morphed, sparse, sparse_without_base, transformed),
        *(variants, strip, occluded, rough),
    )
}
