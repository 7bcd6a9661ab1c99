"""glTF at rest, as viewers show it: weights of morph targets, and joints of skins in place of the node's transform."""

import json

import numpy as np
import pytest
from command import obscurance
from gltf_files import GONE, HALVES, QUAD, Builder, change, check_glb, values
from gltf_samples import quad
from mesh_files import mistake, random_bake, read
from scipy.spatial.transform import Rotation

from obscurance import ao
from obscurance.raytrace.mesh.mesh import TO_Y_UP
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import read_w
from obscurance.scenes.formats.write import write

UP = np.tile([0.0, 0, 1], (4, 1))
BOX = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], "<f4")
SIDES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]  # fmt: skip
TURN = [0, 0, 0.6, 0.8]
JOINTS = [
    {"name": "upper", "rotation": TURN, "translation": [1, 0, 2], "scale": [1, 2, 3], "children": [1]},
    {"name": "lower", "rotation": [0.6, 0, 0, 0.8], "translation": [0, 1, 0]},
]
BIND = np.array([Rotation.from_rotvec([0.1 * k, 0.2, 0]).as_matrix() for k in range(2)])
RNG = np.random.default_rng(3)


def local(node):
    """The matrix of a node, written down once more."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_quat(node.get("rotation", [0, 0, 0, 1])).as_matrix() @ np.diag(
        node.get("scale", [1] * 3)
    )
    made[:3, 3] = node.get("translation", [0, 0, 0])
    return made


def shifted(points, *by):
    return points + np.array(by, float)


def bind_matrices():
    made = np.tile(np.eye(4), (2, 1, 1))
    made[:, :3, :3], made[:, :3, 3] = BIND, [[0, -1, 0], [0.5, 0, -2]]
    return made.astype("<f4")


def give(builder, primitive, joints, weights, number=0):
    """A primitive's influences (n, 4)."""
    primitive["attributes"][f"JOINTS_{number}"] = builder.accessor(np.asarray(joints), "VEC4")
    fields = {} if weights.dtype.kind == "f" else {"normalized": True}
    primitive["attributes"][f"WEIGHTS_{number}"] = builder.accessor(weights, "VEC4", **fields)
    return primitive


def one_joint(builder, primitive, count=4):
    """Influences of joint 0 alone."""
    first = np.tile(np.array([1, 0, 0, 0], "<f4"), (count, 1))
    return give(builder, primitive, np.zeros((count, 4), "u1"), first)


def skin(builder, joints=(0, 1), matrices=None):
    stored = bind_matrices() if matrices is None else np.asarray(matrices, "<f4")
    columns = np.ascontiguousarray(stored.transpose(0, 2, 1)).reshape(-1, 16)
    return {"joints": list(joints), "inverseBindMatrices": builder.accessor(columns, "MAT4")}


def blended(joints, weights):
    """The matrix of each vertex for `JOINTS` and `bind_matrices`, by the definition."""
    upper = local(JOINTS[0])
    world = np.array([upper, upper @ local(JOINTS[1])]) @ bind_matrices().astype(float)
    return np.array(
        [sum(w * world[j] for j, w in zip(*each, strict=True)) for each in zip(joints, weights, strict=True)]
    )


def two_joints(kind="<f4", sets=1):
    """A file of a quad under a node that has a transform of its own, and the matrices of its vertices."""
    builder = Builder()
    joints = RNG.integers(0, 2, (4, 4 * sets))
    weights = RNG.random((4, 4 * sets)) ** 2
    codes = weights / weights.sum(axis=1, keepdims=True)
    largest = 1 if kind == "<f4" else np.iinfo(kind).max
    stored = codes.astype(kind) if largest == 1 else np.rint(codes * largest).astype(kind)
    primitive = builder.primitive(QUAD, HALVES, np.tile([0.6, 0, 0.8], (4, 1)))
    for number in range(sets):
        columns = slice(4 * number, 4 * number + 4)
        chosen = joints[:, columns].astype("<u2" if number else "u1")
        give(builder, primitive, chosen, np.ascontiguousarray(stored[:, columns]), number)
    builder.mesh(primitive)
    nodes = [*JOINTS, {"mesh": 0, "skin": 0, "translation": [50, 0, 0], "scale": [0, 0, 0]}]
    exact = stored / stored.astype(float).sum(axis=1, keepdims=True)
    return builder.glb(nodes, [0, 2], skins=[skin(builder)]), blended(joints, exact)


@pytest.mark.parametrize(("kind", "sets"), [("<f4", 1), ("<f4", 2), ("u1", 1), ("u1", 2), ("<u2", 1)])
def test_joints_are_blended(tmp_path, kind, sets):
    data, matrices = two_joints(kind, sets)
    mesh = read(tmp_path, "in.glb", data).mesh
    placed = (matrices @ np.column_stack([QUAD, np.ones(4)])[:, :, None])[:, :3, 0]
    np.testing.assert_allclose(mesh.vertices, placed, atol=1e-6)
    normals = np.linalg.inv(matrices[:, :3, :3]).transpose(0, 2, 1) @ [0.6, 0, 0.8]
    for got, expected in zip(mesh.normals, normals, strict=True):
        np.testing.assert_allclose(got / np.linalg.norm(got), expected / np.linalg.norm(expected), atol=1e-6)
    (item,) = read_scene(tmp_path / "in.glb").scene.objects  # the node's scale of zero hides nothing
    np.testing.assert_allclose(item.shape.mesh.vertices[: len(placed)], placed, atol=1e-6)


def test_coincident_vertices_stay_coincident(tmp_path):
    """To the bit, wherever they stand in a file and in whatever order it has their influences."""
    builder = Builder()
    count = 40_001
    weights = np.tile(RNG.random(4).astype("<f4"), (count, 1))
    order = RNG.permuted(np.tile(np.arange(4), (count, 1)), axis=1)
    joints = np.take_along_axis(np.tile(np.array([0, 1, 2, 3], "u1"), (count, 1)), order, axis=1)
    primitive = builder.primitive(np.tile(RNG.random(3).astype("<f4"), (count, 1)), [[0, 1, 2]])
    builder.mesh(give(builder, primitive, joints, np.take_along_axis(weights, order, axis=1)))
    nodes = [{"rotation": [s, c, 0, 0]} for s, c in [(0.6, 0.8), (0.8, 0.6), (-0.6, 0.8), (1, 0)]]
    data = builder.glb([*nodes, {"mesh": 0, "skin": 0}], skins=[{"joints": [0, 1, 2, 3]}])
    assert len(np.unique(read(tmp_path, "in.glb", data).mesh.vertices, axis=0)) == 1


def morphed(nodes, weights, targets=None, **fields):
    builder = Builder()
    ones = {"POSITION": builder.accessor(np.tile(np.array([0, 0, 1], "<f4"), (4, 1)), "VEC3")}
    other = {
        "POSITION": builder.accessor(np.zeros((4, 3), "<f4"), "VEC3"),
        "NORMAL": builder.accessor(np.tile(np.array([1, 0, -1], "<f4"), (4, 1)), "VEC3"),
    }
    rows = builder.accessor(np.array([2], "<u2"), "SCALAR")
    places = builder.accessor(np.array([[8, 0, 0]], "<f4"), "VEC3")
    zeros, sparse = (builder.header["accessors"][other["POSITION"]] for _ in range(2))
    del zeros["bufferView"]
    views = {"indices": {"bufferView": rows, "componentType": 5123}, "values": {"bufferView": places}}
    builder.header["accessors"].append({**sparse, "sparse": {"count": 1, **views}})
    last = {"POSITION": len(builder.header["accessors"]) - 1}
    pieces = [ones, other, last] if targets is None else targets
    builder.mesh(builder.primitive(QUAD, HALVES, UP, targets=pieces), weights=weights)
    return builder.glb(nodes, **fields)


def test_weights_of_morph_targets(tmp_path):
    """Of the mesh, or in their place of the node; one target is sparse, one has no stored values at all."""
    nodes = [
        {"mesh": 0},
        {"mesh": 0, "weights": [0, 1, 0], "translation": [0, 0, 7]},
        {"mesh": 0, "weights": [1, 0, 0.25]},
    ]
    file = read(tmp_path, "in.glb", morphed(nodes, [0.5, 0, 0]))
    first, second, third = (slice(4 * k, 4 * k + 4) for k in range(3))
    np.testing.assert_array_equal(file.mesh.vertices[first], shifted(QUAD, 0, 0, 0.5))
    np.testing.assert_array_equal(file.mesh.vertices[second], shifted(QUAD, 0, 0, 7))
    expected = shifted(QUAD, 0, 0, 1)
    expected[2, 0] += 2
    np.testing.assert_array_equal(file.mesh.vertices[third], expected)
    np.testing.assert_array_equal(file.mesh.normals[second], np.tile([1, 0, 0], (4, 1)))
    np.testing.assert_array_equal(file.mesh.normals[third], UP)
    line = "in the pose that viewers show at rest: of 3 primitives 3 by the weights of morph targets"
    assert file.notes == (f"{file.path}: {line}",)
    objects = read_scene(tmp_path / "in.glb").scene.objects
    for item, rows in zip(objects, (first, second, third), strict=True):
        placed = item.shape.mesh.vertices + item.transform[:3, 3]
        np.testing.assert_array_equal(placed, file.mesh.vertices[rows])


def test_targets_move_before_joints(tmp_path):
    builder = Builder()
    moved = {"POSITION": builder.accessor(np.tile(np.array([1, 0, 0], "<f4"), (4, 1)), "VEC3")}
    builder.mesh(one_joint(builder, builder.primitive(QUAD, HALVES, targets=[moved])), weights=[2])
    data = builder.glb(
        [{"scale": [3, 1, 1], "translation": [0, 5, 0]}, {"mesh": 0, "skin": 0}], skins=[{"joints": [0]}]
    )
    expected = shifted(shifted(QUAD, 2, 0, 0) * [3, 1, 1], 0, 5, 0)
    np.testing.assert_array_equal(read(tmp_path, "in.glb", data).mesh.vertices, expected)


def several(roots=None):
    """Two joints, and a box below the one, the other, and twice the first with the same place in the world."""
    builder = Builder()
    builder.mesh(one_joint(builder, builder.primitive(BOX, SIDES), len(BOX)))
    nodes = [{"translation": [0, 0, 2]}, {"translation": [5, 0, 0], "scale": [-1, 1, 1]}]
    nodes += [{"mesh": 0, "skin": number, "translation": [9, 9, number]} for number in (0, 1, 0)]
    return builder.glb(nodes, roots, skins=[{"joints": [0]}, {"joints": [1]}])


def test_a_mesh_has_a_shape_for_each_skin(tmp_path):
    mesh = read(tmp_path, "in.glb", several()).mesh
    np.testing.assert_array_equal(mesh.vertices[:8], shifted(BOX, 0, 0, 2))
    np.testing.assert_array_equal(mesh.vertices[8:16], shifted(BOX * [-1, 1, 1], 5, 0, 0))
    np.testing.assert_array_equal(mesh.vertices[16:], mesh.vertices[:8])
    first, second, third = read_scene(tmp_path / "in.glb").scene.objects
    assert first.shape is third.shape
    assert first.shape is not second.shape
    for k in range(3):  # mirroring joints leave what is outside outside
        a, b, c = (mesh.vertices[mesh.faces[12 * k : 12 * k + 12, corner]] for corner in range(3))
        assert (np.cross(b - a, c - a) * a).sum() == pytest.approx(6)


@pytest.mark.parametrize("roots", [None, [2, 3, 4]])
def test_outputs_of_another_axis_up_turn_the_joints(tmp_path, roots):
    """Of those that the scene does not show, too."""
    source = read(tmp_path, "in.glb", several(roots))
    write(tmp_path / "out.glb", random_bake(24), load(tmp_path / "in.glb", "out.glb", up="z"))
    turned = load(tmp_path / "out.glb").mesh
    np.testing.assert_allclose(turned.vertices, source.mesh.vertices @ np.transpose(TO_Y_UP["z"]), atol=1e-12)
    np.testing.assert_array_equal(turned.faces, source.mesh.faces)


def contents(data):
    """The header, and the bytes of each accessor."""
    header, binary = check_glb(data)
    return header, [values(header, binary, n).tobytes() for n, a in enumerate(header["accessors"]) if "bufferView" in a]


def test_outputs_keep_skins_and_targets_and_the_mesh_unposed(tmp_path):
    data, _ = two_joints("u1", 2)
    source = read(tmp_path, "in.glb", data)
    result = random_bake(4)
    write(tmp_path / "out.glb", result, source, colors="rgb")
    before, after = (contents(path.read_bytes()) for path in (tmp_path / "in.glb", tmp_path / "out.glb"))
    assert after[1][: len(before[1])] == before[1]
    for key in ("skins", "nodes", "scenes"):
        assert after[0][key] == before[0][key]
    (old,), (new,) = before[0]["meshes"][0]["primitives"], after[0]["meshes"][0]["primitives"]
    assert old["attributes"].items() <= new["attributes"].items()
    np.testing.assert_array_equal(read_w(tmp_path / "out.glb", 4), result.w.astype("<f4"))
    np.testing.assert_array_equal(load(tmp_path / "out.glb").mesh.vertices, source.mesh.vertices)
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    colours = values(header, binary, new["attributes"]["COLOR_0"])
    np.testing.assert_array_equal(colours[:, 0], np.rint(result.w * 255))


def test_vertices_that_are_split_for_textures_keep_their_influences(tmp_path):
    data, _ = two_joints()
    file = load(read(tmp_path, "in.glb", data).path, "out.glb")
    corner = np.array([[0.1, 0.1], [0.4, 0.15], [0.2, 0.8]])
    uv = np.stack([corner, shifted(corner, 0.5, 0)])
    (tmp_path / "out.glb").write_bytes(textured_glb(file, [ao.bake_texture(file.mesh, uv, 8, samples=8)])[0])
    again = load(tmp_path / "out.glb").mesh
    assert len(again.vertices) == 6
    np.testing.assert_array_equal(again.vertices[again.faces], file.mesh.vertices[file.mesh.faces])


def test_the_command_tells_the_pose_once(tmp_path):
    (tmp_path / "in.glb").write_bytes(several())
    line = f"{tmp_path / 'in.glb'}: in the pose that viewers show at rest: of 3 primitives 3 by the joints of skins"
    done = obscurance("bake", tmp_path / "in.glb", "-o", tmp_path / "w.npy", "--samples", 8)
    assert done.stderr.count(f"note: {line}\n") == 1
    assert done.stderr.count("in the pose") == 1
    assert read_scene(tmp_path / "in.glb").notes == (line,)


def add_accessor(header, **fields):
    """The number of a copy of the weights' accessor with other fields."""
    header["accessors"].append(
        header["accessors"][header["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"]] | fields
    )
    return len(header["accessors"]) - 1


def one_row(header):
    """A sparse accessor's replacement of row 0, by bytes that are there."""
    indices = header["accessors"][header["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"]]["bufferView"]
    return {"count": 1, "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": 0}}


AT = "meshes[0].primitives[0].attributes"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"nodes/2/skin": 1}, "there is no skins[1]"),
        ({"nodes/2/skin": "0"}, "nodes[2].skin: expected a whole number"),
        ({"skins/0/joints": GONE}, "skins[0].joints: expected a value, got nothing"),
        ({"skins/0/joints": []}, "skins[0].joints: expected nodes of a tree, got none"),
        ({"skins/0/joints": [0, 9]}, "skins[0].joints: expected nodes of a tree, got node 9"),
        ({"nodes/1/children": [0]}, "node 0 has two parents or is its own ancestor"),
        (
            {"nodes/1/children": [0], "scenes/0/nodes": [2]},
            "skins[0].joints: expected nodes of a tree, got node 0, which is not there or its own ancestor",
        ),
        (
            {"skins/0/joints": [0]},
            f"{AT}.JOINTS: expected numbers below 1, of joints of skins[0], got 1",
        ),
        (
            {"skins/0/joints": [0, 1, 0]},
            "skins[0].inverseBindMatrices: expected 3 matrices of finite floats, one a joint, got 2 of float32",
        ),
        ({"skins/0/inverseBindMatrices": 0}, "expected MAT4 of a component type, got VEC3"),
        (
            {"skins/0/inverseBindMatrices": lambda h: add_accessor(h, type="MAT4", count=2, componentType=5121)},
            "skins[0].inverseBindMatrices: expected 2 matrices of finite floats",
        ),
        (
            {"meshes/0/primitives/0/attributes/WEIGHTS_0": GONE},
            f"{AT}.WEIGHTS_0: expected joints and weights of a skinned mesh, got none",
        ),
        (
            {f"meshes/0/primitives/0/attributes/{kind}_0": GONE for kind in ("JOINTS", "WEIGHTS")},
            f"{AT}.JOINTS_0: expected joints and weights of a skinned mesh, got none",
        ),
        (
            {"meshes/0/primitives/0/attributes/JOINTS_1": 0},
            f"{AT}.WEIGHTS_1: expected joints and weights of a skinned mesh, got none",
        ),
        (
            {"meshes/0/primitives/0/attributes/WEIGHTS_0": lambda h: add_accessor(h, count=3)},
            "WEIGHTS_0: expected 4 rows, got 3",
        ),
        (
            {"meshes/0/primitives/0/attributes/JOINTS_0": lambda h: add_accessor(h)},
            f"{AT}.JOINTS_0: expected 4 rows of unsigned integers, got 4 of float32",
        ),
        (
            {
                "meshes/0/primitives/0/attributes/WEIGHTS_0": lambda h: add_accessor(
                    h, bufferView=0, count=4, type="VEC4", byteOffset=0
                )
            },
            "GLTF file, got accessors[",
        ),
        (
            {
                "meshes/0/primitives/0/attributes/WEIGHTS_0": lambda h: (
                    add_accessor(h),
                    h["accessors"][-1].pop("bufferView"),
                )[0]
            },
            f"{AT}.WEIGHTS: expected a weight above 0 at every vertex, got none at vertex 0",
        ),
        (
            {"nodes/2/weights": [1]},
            "nodes[2].weights: expected 0 numbers, one a morph target of mesh",
        ),
        (
            {"meshes/0/weights": [0, 1], "meshes/0/primitives/0/targets": [{"POSITION": 0}]},
            "meshes[0].weights: expected 1 numbers, one a morph target of meshes[0].primitives[0], got 2",
        ),
        (
            {
                "meshes/0/weights": [1],
                "meshes/0/primitives/0/targets": lambda h: [{"POSITION": add_accessor(h, type="VEC3", count=3)}],
            },
            "meshes[0].primitives[0].targets: POSITION: expected 4 rows, got 3",
        ),
        (
            {
                "meshes/0/weights": [1] * 3000,
                "accessors/0/count": 10_000,
                "accessors/0/bufferView": GONE,
                "accessors/0/sparse": one_row,
                "meshes/0/primitives/0/targets": lambda h: [{"POSITION": zeros(h)} for _ in range(3000)],
            },
            "meshes[0].primitives[0].targets: expected at most 20,000,000 moves of vertices, got 30,000,000",
        ),
    ],
)
def test_mistakes(tmp_path, changes, expected):
    builder = Builder()
    weights = np.tile(np.array([0.5, 0.5, 0, 0], "<f4"), (4, 1))
    builder.mesh(give(builder, quad(builder), np.tile(np.array([0, 1, 9, 9], "u1"), (4, 1)), weights))
    skins = [skin(builder)]
    header = builder.gltf([*JOINTS, {"mesh": 0, "skin": 0}], [0, 2], skins=skins)
    (tmp_path / "m.bin").write_bytes(builder.binary)
    header = json.loads(json.dumps(header))
    (tmp_path / "m.gltf").write_text(json.dumps(header))
    load(tmp_path / "m.gltf")
    change(header, changes)
    assert expected in mistake(tmp_path, "m.gltf", json.dumps(header).encode())


def zeros(header):
    header["accessors"].append({"componentType": 5126, "type": "VEC3", "count": 10_000})
    return len(header["accessors"]) - 1


@pytest.mark.parametrize("value", [-0.5, np.nan])
def test_weights_that_are_none(tmp_path, value):
    builder = Builder()
    weights = np.tile(np.array([1, value, 0, 0], "<f4"), (4, 1))
    builder.mesh(give(builder, quad(builder), np.zeros((4, 4), "u1"), weights))
    data = builder.glb([{"mesh": 0, "skin": 0}, {}], skins=[{"joints": [1]}])
    expected = (
        "finite numbers" if np.isnan(value) else "meshes[0].primitives[0].attributes.WEIGHTS_0: expected numbers of"
    )
    assert expected in mistake(tmp_path, "in.glb", data)


def test_matrices_that_are_not_finite(tmp_path):
    builder = Builder()
    builder.mesh(one_joint(builder, quad(builder)))
    matrices = np.full((1, 4, 4), np.inf)
    data = builder.glb([{"mesh": 0, "skin": 0}, {}], skins=[skin(builder, [1], matrices)])
    message = mistake(tmp_path, "in.glb", data)
    assert "skins[0].inverseBindMatrices: expected 1 matrices of finite floats, one a joint, got 1 of others" in message
