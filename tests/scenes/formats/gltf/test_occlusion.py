"""Occlusion textures in a glTF document: which materials and texture coordinates they take."""

import struct

import numpy as np
import pytest

from obscurance.scenes.formats.gltf.builder import GlbBuilder
from obscurance.scenes.formats.gltf.occlusion import (
    RAMP,
    OcclusionTextures,
    add_coordinates,
    free_set,
)
from obscurance.scenes.formats.gltf.write import ramp_coordinates, ramp_png


def document(primitives, materials=(), **fields):
    header = {"meshes": [{"primitives": primitives}], "materials": list(materials), **fields}
    return GlbBuilder(header)


def primitive(*sets, **fields):
    return {"attributes": {"POSITION": 0} | {f"TEXCOORD_{n}": 1 for n in sets}, **fields}


def give_ramps(packed, pieces=None, replace=False):
    textures = OcclusionTextures(packed, replace)
    ramp = textures.add(ramp_png(), RAMP)
    pieces = packed.header["meshes"][0]["primitives"] if pieces is None else pieces
    for piece in pieces:
        if textures.materials(piece):
            number = free_set(packed.header, piece)
            add_coordinates(packed, piece, number, np.zeros((3, 2)))
            textures.give(piece, ramp, number)
    textures.apply()
    return packed.header


def test_the_ramp_is_grey_codes_without_a_colour_space():
    data, at, chunks = ramp_png(), 8, []
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        chunks.append(kind)
        at += 12 + size
    assert data[16:26] == struct.pack(">IIBB", 256, 4, 8, 0)
    assert not {b"sRGB", b"gAMA", b"cHRM", b"iCCP", b"cICP"} & set(chunks)


def test_coordinates_reach_from_the_centre_of_the_first_texel_to_that_of_the_last():
    u, v = ramp_coordinates(np.array([0.0, 0.5, 1.0, -0.1, 1.1])).T
    np.testing.assert_allclose(u * 256 - 0.5, [0, 127.5, 255, 0, 255])
    assert (v == 0.5).all()


@pytest.mark.parametrize(
    ("piece", "free"),
    [
        (primitive(), 0),
        (primitive(0), 1),
        (primitive(0, 1), 2),
        (primitive(0, 2), 1),
        (primitive(1), 0),
        (primitive(0, targets=[{"TEXCOORD_1": 0}]), 2),
        (primitive(material=0), 1),  # its colour refers to set 0, which is missing
        (primitive(0, material=1), 3),  # its sets are 0 without the extension, and 2 with it
        (primitive(0, material=2), 2),  # its extension's own texture uses set 1
        (primitive(0, extensions={"KHR_materials_variants": {"mappings": [{"material": 2, "variants": [0]}]}}), 2),
        (primitive(0, material=9), 1),
    ],
)
def test_the_first_free_set(piece, free):
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 2}}, "texCoord": 1}
    materials = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        {"normalTexture": moved},
        {"extensions": {"KHR_materials_sheen": {"sheenColorTexture": {"index": 0, "texCoord": 1}}}},
    ]
    assert free_set(document([piece], materials).header, piece) == free


def test_missing_sets_below_become_zeros():
    piece = primitive(material=0)
    header = give_ramps(document([piece], [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]))
    assert set(piece["attributes"]) == {"POSITION", "TEXCOORD_0", "TEXCOORD_1"}
    assert header["materials"][0]["occlusionTexture"]["texCoord"] == 1


def test_a_material_of_alike_primitives_is_not_copied():
    pieces = [primitive(0, material=0), primitive(0, material=0)]
    header = give_ramps(document(pieces, [{"name": "steel"}]))
    assert header["materials"] == [{"name": "steel", "occlusionTexture": {"index": 0, "texCoord": 1}}]
    assert [piece["material"] for piece in pieces] == [0, 0]


def test_a_material_becomes_one_for_every_set():
    pieces = [primitive(0, material=0), primitive(material=0), primitive(0, material=0)]
    header = give_ramps(document(pieces, [{"name": "steel"}]))
    assert [piece["material"] for piece in pieces] == [0, 1, 0]
    assert [made["occlusionTexture"] for made in header["materials"]] == [{"index": 0, "texCoord": 1}, {"index": 0}]
    assert all(made["name"] == "steel" for made in header["materials"])


def test_primitives_that_get_none_keep_their_material():
    pieces = [primitive(0, material=0), primitive(0, material=0)]
    header = give_ramps(document(pieces, [{"name": "steel"}]), pieces[1:])
    assert [piece["material"] for piece in pieces] == [0, 1]
    assert "occlusionTexture" not in header["materials"][0]


def test_primitives_without_material_share_a_new_default_one():
    pieces = [primitive(), primitive(), primitive(0)]
    header = give_ramps(document(pieces))
    assert [piece["material"] for piece in pieces] == [0, 0, 1]
    assert header["materials"] == [
        {"occlusionTexture": {"index": 0}},
        {"occlusionTexture": {"index": 0, "texCoord": 1}},
    ]
