"""w in one channel of the colours of vertices, read back by readers that are not ours."""

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from gltf_files import HALVES, QUAD, Builder, check_glb
from kept_contents import columns
from mesh_files import mesh_file, random_bake, rich_ply
from trimesh.exchange.gltf import load_glb

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.image.colour import decode_srgb, encode_srgb
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.unsupported import unsupported_features
from obscurance.scenes.formats.write import channels, write

RGBA = {"r": "red", "g": "green", "b": "blue", "a": "alpha"}
W = random_bake(4)
LARGEST = {"<f4": 1, "<u1": 255, "<u2": 65535}


def ply_with(tmp_path, kinds, colors, ending="ply"):
    """A quad with the colours (4, c) in a binary PLY, whose columns are of `kinds`."""
    names = dict(zip(RGBA.values(), kinds, strict=False))
    types = {"f": "float", "B": "uchar", "H": "ushort"}
    head = ["ply", "format binary_little_endian 1.0", "element vertex 4", *(f"property float {axis}" for axis in "xyz")]
    head += [f"property {types[kind]} {name}" for name, kind in names.items()]
    head += ["element face 2", "property list uchar int vertex_indices", "end_header\n"]
    rows = np.zeros(4, [("p", "<f4", 3), *((name, "<" + kind) for name, kind in names.items())])
    rows["p"] = QUAD
    for name, column in zip(names, np.transpose(colors), strict=True):
        rows[name] = column
    faces = np.array([(3, (0, 1, 2)), (3, (0, 2, 3))], [("n", "u1"), ("v", "<i4", 3)])
    (tmp_path / "in.ply").write_bytes("\n".join(head).encode() + rows.tobytes() + faces.tobytes())
    return load(tmp_path / "in.ply", f"out.{ending}")


def vertex_rows(path):
    return trimesh.load_mesh(path, process=False).metadata["_ply_raw"]["vertex"]["data"]


def glb_colors(path):
    """COLOR_0 of all primitives, one after the other, as trimesh takes it out of the file."""
    with path.open("rb") as file:
        made = load_glb(file)["geometry"].values()
    return np.concatenate(
        [each["visual"].vertex_attributes["color"] if "visual" in each else each["vertex_colors"] for each in made]
    )


@pytest.mark.parametrize("channel", RGBA)
@pytest.mark.parametrize("kinds", ["BBB", "BBBB", "fff", "HHHH"])
def test_a_ply_keeps_the_bits_of_the_other_channels(tmp_path, kinds, channel):
    rng = np.random.default_rng(3)
    largest = LARGEST["<" + kinds[0].replace("B", "u1").replace("H", "u2").replace("f", "f4")]
    colors = rng.random((4, len(kinds))) if largest == 1 else rng.integers(0, largest, (4, len(kinds)))
    source = ply_with(tmp_path, kinds, colors)
    write(tmp_path / "out.ply", W, source, colors=channel)
    before, after = vertex_rows(tmp_path / "in.ply"), vertex_rows(tmp_path / "out.ply")
    kept = [name for name in before.dtype.names if name != RGBA[channel]]
    assert all(after[name].dtype == before[name].dtype for name in kept)
    assert all(after[name].tobytes() == before[name].tobytes() for name in kept)
    made = after[RGBA[channel]] / largest
    assert after[RGBA[channel]].dtype == before["red"].dtype
    np.testing.assert_allclose(made, W.w if channel == "a" else encode_srgb(W.w), atol=max(1e-6, 0.501 / largest))
    assert unsupported_features(tmp_path / "out.ply", source, channels("m.ply", channel, None, False)) == []


@pytest.mark.parametrize("channel", RGBA)
@pytest.mark.parametrize(("kind", "width"), [("<u1", 3), ("<u1", 4), ("<u2", 3), ("<f4", 3), ("<f4", 4)])
def test_a_glb_keeps_the_bits_of_the_other_channels_in_each_instance(tmp_path, kind, width, channel):
    largest, builder, rng = LARGEST[kind], Builder(), np.random.default_rng(4)
    stored = (rng.random((4, width)) * largest).astype(kind)
    quad = builder.primitive(QUAD, HALVES)
    padded = stored if kind == "<f4" or width == 4 else np.pad(stored, ((0, 0), (0, 1)))
    quad["attributes"]["COLOR_0"] = builder.accessor(padded, f"VEC{width}", normalized=largest > 1)
    if padded is not stored:
        builder.header["bufferViews"][-1]["byteStride"] = 4 * padded.itemsize
    builder.mesh(quad)
    (tmp_path / "in.glb").write_bytes(builder.glb([{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]))
    bake = random_bake(8)
    write(tmp_path / "out.glb", bake, load(tmp_path / "in.glb", "out.glb"), colors=channel)
    check_glb((tmp_path / "out.glb").read_bytes())
    colors = glb_colors(tmp_path / "out.glb")
    assert (colors.dtype, colors.shape) == (np.dtype(kind), (8, 4))
    found = np.split(colors, 2)
    place = "rgba".index(channel)
    whole = np.full((4, 4), largest, kind)
    whole[:, :width] = stored
    for each in found:
        assert np.delete(each, place, axis=1).tobytes() == np.delete(whole, place, axis=1).tobytes()
    made = np.concatenate([each[:, place] for each in found]) / largest
    np.testing.assert_allclose(made, bake.w, atol=max(1e-6, 0.501 / largest))  # linear


def test_without_colours_the_other_channels_are_one(tmp_path):
    for channel, place in zip(RGBA, range(4), strict=True):
        for ending in ("ply", "glb"):
            write(tmp_path / f"m.{ending}", W, mesh_file(), colors=channel)
        ply = trimesh.load_mesh(tmp_path / "m.ply", process=False).visual.vertex_colors
        assert (np.delete(ply, place, axis=1) == 255).all()
        assert np.ptp(ply[:, place])
        colors = glb_colors(tmp_path / "m.glb")
        assert (np.delete(colors, place, axis=1) == 255).all()
        np.testing.assert_array_equal(colors[:, place], np.rint(255 * W.w))


def test_two_bakes_share_the_colours_of_one_file(tmp_path):
    """Also where the first has made the grey of all channels."""
    other = random_bake(4)
    other.w = 1 - W.w
    for ending in ("ply", "glb"):
        for first in ("r", "rgb"):
            write(tmp_path / f"one.{ending}", W, mesh_file(), colors=first)
            for target in {ending, "glb"}:
                source = load(tmp_path / f"one.{ending}", f"two.{target}")
                write(tmp_path / f"two.{target}", other, source, colors="g")
            red, green, blue = glb_colors(tmp_path / "two.glb")[:, :3].T / (255 if ending == "glb" else 1)
            np.testing.assert_allclose(red, W.w, atol=0.006)
            np.testing.assert_allclose(green, other.w, atol=0.006)
            np.testing.assert_allclose(blue, W.w if first == "rgb" else 1, atol=0.006)
    rows = vertex_rows(tmp_path / "two.ply")
    np.testing.assert_allclose(decode_srgb(rows["red"] / 255), W.w, atol=0.006)
    assert "comment obscurance: 1 = open; green = obscurance as sRGB\n" in (tmp_path / "two.ply").read_text("latin-1")


def test_colours_go_to_the_other_format(tmp_path):
    text = "".join(f"v {x} {y} {z} 0 .25 1\n" for x, y, z in QUAD.tolist())
    (tmp_path / "m.obj").write_text(text + "f 1 2 3\nf 1 3 4\n")
    write(tmp_path / "m.glb", W, load(tmp_path / "m.obj", "m.glb"), colors="a")
    expected = [0, decode_srgb(0.25), 1]
    np.testing.assert_allclose(glb_colors(tmp_path / "m.glb"), [[*expected, w] for w in W.w], atol=1e-6)
    for source in ("m.obj", "m.glb"):
        write(tmp_path / "m.ply", W, load(tmp_path / source, "m.ply"), colors="r")
        rows = vertex_rows(tmp_path / "m.ply")
        assert (set(rows["green"]), set(rows["blue"])) == ({64}, {255})
        np.testing.assert_array_equal(rows["red"], np.rint(255 * encode_srgb(W.w)))


def test_the_command(tmp_path, monkeypatch):
    """`--colors` has a value or none, before a file's name too; a text PLY with a list keeps its polygons."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 3\nf 1 3 4\nf 1 2 4\n")
    (tmp_path / "rich.ply").write_bytes(rich_ply())
    few = ("--samples", 8, "-q")
    for line in (
        ["--colors", "m.obj", "-o", "a.glb"],
        ["m.obj", "-o", "b.glb", "--colors", "rgb", "--report", "b.json"],
        ["m.obj", "-o", "c.glb", "--options", "b.json"],
    ):
        succeeded("bake", *line, *few)
    assert len({(tmp_path / f"{name}.glb").read_bytes() for name in "abc"}) == 1
    succeeded("bake", "rich.ply", "-o", "g.ply", "--colors", "g", *few)
    rows = {name: column.values for name, column in columns(tmp_path / "g.ply")[0]["vertex"].items()}
    assert (set(rows["red"]), set(rows["blue"]), set(rows["alpha"])) == ({250}, {0}, {255})
    refused(obscurance("bake", "m.obj", "-o", "w.ply", "--colors", "x"), "expected one of rgb, r, g, b, a, got x")
    refused(obscurance("bake", "m.obj", "-o", "w.npy", "--colors", "r"), "--colors needs a .glb or .ply output")


def test_colours_that_cannot_be_kept_are_refused_before_the_bake(tmp_path):
    builder = Builder()
    quad = builder.primitive(QUAD, HALVES)
    quad["attributes"]["COLOR_0"] = builder.accessor(np.ones((3, 4), "<f4"), "VEC4")
    builder.mesh(quad)
    (tmp_path / "in.glb").write_bytes(builder.glb([{"mesh": 0}]))
    source = load(tmp_path / "in.glb", "out.glb")
    with pytest.raises(MeshError, match=r"in\.glb: COLOR_0: expected 4 rows, got 3"):
        unsupported_features(tmp_path / "out.glb", source, channels("out.glb", "r", None, False))
    assert unsupported_features(tmp_path / "out.glb", source, channels("out.glb", "rgb", None, False))
