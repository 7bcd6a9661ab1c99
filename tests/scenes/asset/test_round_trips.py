"""Files that hold what their format can are read, baked, written in it and in others, and read again."""

import numpy as np
import pytest
import validator
from command import obscurance, succeeded
from gltf_files import QUAD, Builder
from mesh_files import rich_ply
from pages import facts_of
from PIL import Image
from vtp_files import Writer

from obscurance.ao import Profile
from obscurance.raytrace.errors import MeshError
from obscurance.scenes.asset.primitive import BAKED, StoredBake
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.unsupported import unsupported_features
from obscurance.scenes.formats.write import write

OBJ = """mtllib m.mtl
o first
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1 1 0 0 0 1
v 0 1 0 1 1 0
vt 0 0
vt .5 0
vt 1 .25
vt 0 1
vn 0 0 1
vn 0 0.6 0.8
usemtl red
f 1/1/1 2/2/1 3/3/2 4/4/1
o second
usemtl blue
f 1/4/2 3/3/1 2/2/1
"""
MTL = "newmtl red\nKd .8 .1 .1\nmap_Kd paint.png\nd .5\nnewmtl blue\nKd .1 .1 .8\nKs .4 .4 .4\nNs 30\n"


def gltf():
    """Two nodes of one mesh, below a third; sets of coordinates, colours, tangents, materials, a camera, a light."""
    builder = Builder()
    primitive = builder.primitive(QUAD, [[0, 1, 2], [0, 2, 3]], normals=np.tile([0, 0, 1], (4, 1)).astype("<f4"))
    uv = QUAD[:, :2].astype("<f4")
    for name, values, kind in (
        ("TEXCOORD_0", uv, "VEC2"), ("TEXCOORD_1", uv[::-1].copy(), "VEC2"), ("_HEAT", QUAD[:, 0].copy(), "SCALAR"),
        ("COLOR_0", np.linspace(0, 1, 16, dtype="<f4").reshape(4, 4), "VEC4"),
        ("TANGENT", np.tile([1, 0, 0, 1], (4, 1)).astype("<f4"), "VEC4"),
    ):  # fmt: skip
        primitive["attributes"][name] = builder.accessor(values, kind)
    builder.mesh(primitive | {"material": 0})
    materials = [{"name": "paint", "pbrMetallicRoughness": {"roughnessFactor": 0.25}, "doubleSided": True}]
    nodes = [{"name": "a", "mesh": 0}, {"name": "b", "mesh": 0, "translation": [0, 0, 2]}, {"name": "c", "camera": 0}]
    cameras = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]
    return builder.glb([*nodes, {"children": [0, 1, 2]}], [3], materials=materials, cameras=cameras)


RICH = {".obj": OBJ.encode(), ".ply": rich_ply(), ".glb": gltf(), ".vtp": Writer("binary").document()}
LEFT = {".obj": {"colours"}, ".ply": set(), ".glb": set(), ".vtp": {"uv0"}}
"""What of a format's own file is lost: w stands where colours stood; and no coordinates in a .vtp."""


@pytest.fixture
def folder(tmp_path):
    for ending, content in RICH.items():
        (tmp_path / f"m{ending}").write_bytes(content)
    (tmp_path / "m.mtl").write_text(MTL)
    Image.new("RGB", (2, 2), (200, 100, 50)).save(tmp_path / "paint.png")
    return tmp_path


def made(count):
    """A bake of so many vertices, with everything that is stored, as the numbers that files hold."""
    rng = np.random.default_rng(count)
    lengths = 0.25 * 2.0 ** np.arange(6)
    bent = rng.normal(size=(count, 3))
    return StoredBake(
        w=np.float32(rng.random(count)).astype(float),
        error=np.float32(rng.random(count) / 50).astype(float),
        flags=rng.integers(0, 256, count).astype(np.uint8),
        bent_normals=np.float32(bent / np.linalg.norm(bent, axis=1, keepdims=True)).astype(float),
        profile=Profile(lengths, np.rint(rng.random((count, 6)) * 255) / 255, 2.0),
    )


def content(asset):
    """What a file holds, by name."""
    mesh = asset.mesh
    held = {
        "vertices": mesh.vertices, "corners": asset.corners, "sizes": asset.sizes, "normals": mesh.normals,
        "uv0": asset.uv, "uv1": asset.texture_coordinates(1), "colours": asset.colours(), "objects": asset.objects,
        "materials": [material._replace(texture=None, images=None, occlusion=None) for material in asset.materials],
        "pictures": [material.pictures for material in asset.materials],
        "runs": [(run.faces.tolist(), run.material.name, run.object.name) for run in asset.runs()],
        **{f"number {name}": values for name, values in asset.numbers.items()},
    }  # fmt: skip
    if mesh.corner_normals:
        held["corner_normals"] = mesh.corner_normals.values[mesh.corner_normals.of]
    return held


def differing(one, other):
    """The names of what two files hold otherwise."""

    def same(name):
        if isinstance(one[name], np.ndarray) and isinstance(other.get(name), np.ndarray):
            return np.array_equal(one[name], other[name], equal_nan=True)
        return one[name] is other.get(name) is None or (name in other and np.all(one[name] == other[name]))

    return {name for name in one if not same(name)}


@pytest.mark.parametrize("ending", RICH)
def test_a_file_that_holds_everything_keeps_it_in_its_own_format(folder, ending):
    before = load(folder / f"m{ending}")
    rich = {".obj": "corner_normals", ".ply": "number quality", ".glb": "uv1", ".vtp": "uv0"}[ending]
    assert content(before)[rich] is not None
    target = folder / f"w{ending}"
    lost = " ".join(unsupported_features(target, load(folder / f"m{ending}", target)))
    write(target, made(len(before.mesh.vertices)), load(folder / f"m{ending}", target))
    after = content(load(target))
    named = {"runs", "objects"} if ending != ".obj" else set()  # by the file's name, where nothing else names them
    assert differing(content(before), after) - named == LEFT[ending]
    for name in LEFT[ending]:
        assert {"colours": "its colours", "uv0": "texture coordinates"}[name] in lost
    if ending == ".glb":
        headers = [load(folder / name).raw.header for name in ("m.glb", "w.glb")]
        for key in ("materials", "cameras", "scenes"):
            old = [{k: v for k, v in one.items() if k != "occlusionTexture"} for one in headers[1][key]]
            assert old[: len(headers[0][key])] == headers[0][key]
        attributes = headers[1]["meshes"][0]["primitives"][0]["attributes"]
        assert {"TANGENT", "_HEAT", "COLOR_0"} <= attributes.keys()
    if ending == ".ply":
        elements = [
            {element.name: element for element in load(folder / name).raw.elements} for name in ("m.ply", "w.ply")
        ]
        for name in ("face", "edge"):
            for one, two in zip(elements[0][name].properties, elements[1][name].properties, strict=True):
                np.testing.assert_array_equal(one.values, two.values)


@pytest.mark.parametrize("source", RICH)
@pytest.mark.parametrize("target", ["ply", "glb", "vtp"])
def test_a_bake_is_read_again_wholly(folder, source, target):
    asset = load(folder / f"m{source}", folder / f"w.{target}")
    bake = made(len(asset.mesh.vertices))
    write(folder / f"w.{target}", bake, asset)
    stored = load(folder / f"w.{target}")
    # Vertices that a .glb repeats or puts elsewhere are found by their places.
    rows = np.arange(len(bake.w))
    if len(stored.mesh.vertices) != len(rows) or not np.allclose(stored.mesh.vertices, asset.mesh.vertices):
        places = {tuple(place): row for row, place in enumerate(asset.mesh.vertices.round(6).tolist())}
        rows = np.array([places[tuple(place)] for place in stored.mesh.vertices.round(6).tolist()])
    for name in BAKED:
        np.testing.assert_array_equal(getattr(stored.baked, name), getattr(bake, name)[rows], name)
    if target != "vtp":
        np.testing.assert_allclose(stored.profile.values, bake.profile.values[rows], atol=1e-4)
    assert not [name for name in stored.numbers if name.startswith("obscurance")]
    # Once more, by the file alone; another bake takes the place of all of it.
    stored.save(folder / f"again.{target}")
    again = load(folder / f"again.{target}").baked
    for name in BAKED:
        np.testing.assert_array_equal(getattr(again, name), getattr(stored.baked, name))
    bare = load(folder / f"w.{target}", folder / f"bare.{target}")
    write(folder / f"bare.{target}", StoredBake(np.ones(len(bare.mesh.vertices))), bare)
    found = load(folder / f"bare.{target}").baked
    assert (found.error, found.flags, found.bent_normals, found.profile) == (None,) * 4
    assert found.w.min() == 1


@pytest.mark.parametrize("target", ["ply", "glb", "vtp", "npz"])
def test_pages_and_other_half_distances_have_what_a_bake_has_left(folder, target):
    succeeded(
        "bake", folder / "m.ply", "-o", folder / f"w.{target}", "--samples", 16, *(["--profile"] * (target != "vtp"))
    )
    mesh = ["--mesh", folder / "m.ply"] * (target == "npz")
    succeeded("view", folder / f"w.{target}", "-o", folder / "w.html", *mesh)
    facts = facts_of((folder / "w.html").read_bytes())
    assert {"w0", "error0", "flags0", "bent0"} <= {name for name, *_ in facts["columns"]}
    if target != "vtp":
        done = obscurance("falloff", folder / f"w.{target}", "--half-distance", "3%", "-o", folder / "f.npz")
        assert done.returncode == 0, done.stderr
        with np.load(folder / "f.npz") as arrays:
            assert len(arrays["flags"]) == len(arrays["w"])


@pytest.mark.skipif(validator.missing() is not None, reason=str(validator.missing()))
def test_the_validator_finds_no_error_in_a_glb_with_all_of_a_bake(folder):
    targets = [folder / f"of{source[1:]}.glb" for source in RICH]
    for source, target in zip(RICH, targets, strict=True):
        asset = load(folder / f"m{source}", target)
        write(target, made(len(asset.mesh.vertices)), asset)
    assert validator.errors(*targets) == [[]] * len(targets)


def test_columns_of_a_ply_that_are_called_as_those_of_a_bake_are_the_files_own(folder):
    data = (folder / "m.ply").read_bytes().replace(b"quality", b"error  ").replace(b"float s\n", b"float w\n")
    (folder / "o.ply").write_bytes(data)
    asset = load(folder / "o.ply")
    assert {"error", "w"} <= asset.numbers.keys()
    assert asset.baked is None
    write(folder / "o2.ply", made(6), load(folder / "o.ply", "o2.ply"))
    np.testing.assert_array_equal(load(folder / "o2.ply").numbers["error"], asset.numbers["error"])


def test_attributes_of_other_shapes_are_no_bake(folder):
    builder = Builder()
    primitive = builder.primitive(QUAD, [[0, 1, 2]])
    primitive["attributes"] |= {
        "_OBSCURANCE": builder.accessor(QUAD[:, 0].copy(), "SCALAR"),
        "_OBSCURANCE_ERROR": builder.accessor(QUAD.copy(), "VEC3"),
        "_OBSCURANCE_FLAGS": builder.accessor(QUAD[:3, 0].copy(), "SCALAR"),
        "_OBSCURANCE_BENT_NORMALS": 99,
    }
    builder.mesh(primitive)
    (folder / "o.glb").write_bytes(builder.glb([{"mesh": 0}]))
    stored = load(folder / "o.glb").baked
    assert (stored.error, stored.flags, stored.bent_normals) == (None, None, None)
    short = Writer("ascii").array("flags", [1, 2], "f4")
    text = (folder / "m.vtp").read_text().replace("</PointData>", short + "</PointData>")
    (folder / "o.vtp").write_text(text)
    with pytest.raises(MeshError, match="columns of points that are not one row"):
        load(folder / "o.vtp")
