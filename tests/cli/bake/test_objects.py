"""`--receive`, `--cast` and `--exclude`: objects of a file by name, against meshes made without them by hand."""

import json
import math
import shlex

import numpy as np
import pytest
from command import refused_without_a_trace, succeeded
from gltf_files import Builder
from uv_meshes import grid_charts

from obscurance import ao, scenes
from obscurance.raytrace import Mesh, OptionError
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.geometry.polyhedra import icosphere, join

FEW = "--samples", "32", "--half-distance", "0.4"
FALLOFF = ao.Exponential(half_distance=0.4)
SPHERE, FACES = icosphere(2)
DENT = np.exp(-4 * ((SPHERE - [1, 0, 0]) ** 2).sum(axis=1, keepdims=True))
BALL = SPHERE * (1 - 0.7 * DENT), FACES
N = len(BALL[0])
PLACES = {"body": (1.0, 0.0), "hat": (0.6, 1.45), "body_collision": (1.25, 0.0), "shoe": (0.5, -1.4)}
BALLS = {name: (radius * BALL[0] + [0, y, 0], BALL[1]) for name, (radius, y) in PLACES.items()}
ROWS = {name: slice(i * N, (i + 1) * N) for i, name in enumerate(BALLS)}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The same dented balls as an OBJ and as a .glb with charts of their own."""
    monkeypatch.chdir(tmp_path)
    lines, builder, nodes = [], Builder(), []
    for number, (name, (vertices, faces)) in enumerate(BALLS.items()):
        lines += [f"o {name}", *("v {} {} {}".format(*each) for each in vertices)]
        lines += ["f {} {} {}".format(*each) for each in faces + 1 + number * N]
        corners = vertices[faces].reshape(-1, 3).astype("<f4")
        part = builder.primitive(corners, np.arange(len(corners)).reshape(-1, 3))
        charts = (grid_charts(len(faces)).reshape(-1, 2) + divmod(number, 2)) / 2
        part["attributes"]["TEXCOORD_0"] = builder.accessor(charts.astype("<f4"), "VEC2")
        nodes.append({"mesh": builder.mesh(part), "name": name})
    (tmp_path / "m.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "m.glb").write_bytes(builder.glb(nodes))
    return tmp_path


def baked(*options, mesh="m.obj", output="w.npy"):
    done = succeeded("bake", mesh, "-o", output, *FEW, *options)
    return np.load(output) if output == "w.npy" else done


def by_hand(*names, occluders=(), **options):
    """w of these balls in one mesh."""
    mesh, walls = (Mesh(*join(BALLS[name] for name in some)) if some else None for some in (names, occluders))
    w = ao.bake(mesh, FALLOFF, 32, occluders=[walls] if walls else [], **options).w
    return dict(zip(names, w.astype(np.float32).reshape(-1, N), strict=True))


def check(w, expected):
    for name, rows in ROWS.items():
        assert np.array_equal(w[rows], expected.get(name, np.ones(N))), name


def test_excluded_objects_are_as_if_deleted(folder):
    check(baked("--exclude", "*_collision"), by_hand("body", "hat", "shoe"))
    check(baked("--exclude", "body_*", "--exclude", "hat"), by_hand("body", "shoe"))
    check(baked("--exclude", "!body"), by_hand("body"))


def test_all_but_the_receiving_objects_only_occlude(folder):
    check(baked("--receive", "body"), by_hand("body", occluders=["hat", "body_collision", "shoe"]))
    some = "--exclude", "*_collision", "--receive", "body*", "--receive", "hat"
    check(baked(*some), by_hand("body", "hat", occluders=["shoe"]))
    whole = by_hand("body", "hat", "shoe", denoise=False)
    check(baked(*some, "--no-denoise"), {name: whole[name] for name in ("body", "hat")})
    w = baked(*some, "--tolerance", "0.02", "--samples", "4096")
    mesh, shoe = Mesh(*join([BALLS["body"], BALLS["hat"]])), Mesh(*BALLS["shoe"])
    assert np.array_equal(w[: 2 * N], ao.bake(mesh, FALLOFF, 4096, tolerance=0.02, occluders=[shoe]).w.astype("f4"))


def test_a_ball_over_a_plane(folder):
    """Either receives or occludes alone: the plane's w is 1 - cosine r²/d², the ball's that of half a sky or of all."""
    (x, y), flat = np.mgrid[-2:2:9j, -2:2:9j].reshape(2, -1), np.arange(64).reshape(8, 8) // 8 * 9 + np.arange(8)
    corners = np.stack([flat, flat + 9, flat + 10, flat + 1], -1).reshape(-1, 4)
    ball = icosphere(4)[0] + [0, 0, 1.5]
    faces = icosphere(4)[1] + 82
    lines = ["o plane", *map("v {} {} 0".format, x, y), *("f {} {} {} {}".format(*each) for each in corners + 1)]
    lines += ["o ball", *map("v {} {} {}".format, *ball.T), *("f {} {} {}".format(*each) for each in faces)]
    (folder / "over.obj").write_text("\n".join(lines) + "\n")
    options = "--falloff", "binary", "--samples", "1024", "--no-denoise"
    plane = 1 - 1.5 / (x**2 + y**2 + 1.5**2) ** 1.5
    for some in (("--cast", "ball"), ("--receive", "plane"), ("--receive", "plane", "--cast", "!plane")):
        succeeded("bake", "over.obj", "-o", "w.npy", *options, *some)
        w = np.load("w.npy")
        assert np.abs(w[:81] - plane).max() < 0.01
        assert (w[81:] > 0.999).all()
    succeeded("bake", "over.obj", "-o", "w.npy", *options, "--cast", "plane")
    w = np.load("w.npy")
    assert (w[:81] == 1).all()
    assert w[81:].min() < 0.75


def test_reports_repeat_them(folder):
    some = "--exclude", "*_collision", "--receive", "body", "--receive", "hat", "--cast", "!body"
    w = baked(*some, "--report", "r.json")
    report = json.loads((folder / "r.json").read_text())
    assert report["options"]["receive"] == ["body", "hat"]
    for command in (shlex.split(report["command"])[1:], ["bake", "-o", "w.npy", "--options", "r.json"]):
        (folder / "w.npy").unlink()
        succeeded(*command)
        assert np.array_equal(np.load("w.npy"), w)
    assert "324 vertices" in baked(*some, "--dry-run", output="none.npy").stdout


def test_textures_and_glb(folder):
    """A quarter of the page for each ball; what gets no w has no texels, and no occlusion texture in the file."""
    some = "--exclude", "*_collision", "--receive", "body"
    baked(*some, "--size", "64", mesh="m.glb", output="t.exr")
    texture = read_image("t.exr")[0]["beauty"][..., 0]
    (vertices, faces), uv = join([BALLS["body"], BALLS["hat"], BALLS["shoe"]]), scenes.load("m.glb").uv
    count = len(BALL[1])
    alone = np.concatenate([uv[:count], np.full((2 * count, 3, 2), np.nan)])
    corners = vertices[faces].reshape(-1, 3).astype("f4")
    mesh = Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    assert np.array_equal(texture, ao.bake_texture(mesh, alone, 64, FALLOFF, 32).w.astype("f4"))
    baked(*some, "--size", "64", "--occlusion", "texture", mesh="m.glb", output="t.glb")
    materials = scenes.load("t.glb").raw.header["materials"]
    assert ["occlusionTexture" in each for each in materials].count(True) == 1
    baked(*some, mesh="m.glb", output="w.glb")
    w = scenes.load("w.glb").w
    assert (w[3 * count :] == 1).all()
    assert w[: 3 * count].mean() < 0.97


def test_objects_alone_are_as_in_files_of_their_own(folder):
    alone = {name: by_hand(name)[name] for name in BALLS}
    assert all(w.min() < 0.85 for w in alone.values())
    check(baked("--occluded-by", "object"), alone)
    check(baked("--occluded-by", "name", "--receive", "hat", "--exclude", "body"), {"hat": alone["hat"]})
    floor = ao.ground(Mesh(*join(BALLS.values())))
    over = {name: ao.bake(Mesh(*BALLS[name]), FALLOFF, 32, occluders=[floor]).w.astype("f4") for name in BALLS}
    check(baked("--occluded-by", "object", "--ground", "auto"), over)
    radius = scenes.load("m.obj").mesh.radius
    share = f"{40 / radius:.17g}%"
    assert np.allclose(baked("--occluded-by", "object", "--half-distance", share)[ROWS["hat"]], alone["hat"], atol=1e-6)
    baked("--occluded-by", "object", "--tolerance", "0.02", "--report", "r.json", output="w.ply")
    report = json.loads((folder / "r.json").read_text())
    assert 0 < report["rmse_estimate"] < 0.02
    assert report["options"]["occluded_by"] == "object"
    twice = (folder / "m.glb").read_bytes().replace(b'"hat"', b'"bat"').replace(b'"shoe"', b'"bat" ')
    (folder / "twice.glb").write_bytes(twice)
    baked("--occluded-by", "name", "--occlusion", "ramp", mesh="twice.glb", output="w.glb")
    baked("--occluded-by", "object", "--occlusion", "ramp", mesh="twice.glb", output="o.glb")
    by_name, by_object = (scenes.load(name).w.reshape(4, -1) for name in ("w.glb", "o.glb"))
    same = (by_name == by_object).all(axis=1)
    assert same.tolist() == [True, False, True, False]


def test_objects_alone_at_faces_on_both_sides_and_with_a_profile(folder):
    """As each is in a file of its own; the profile's half-distances are shares of the radius of all."""
    baked("--occluded-by", "object", "--at", "faces", "--both-sides", "--report", "r.json", output="f.npz")
    found, starts = np.load("f.npz"), np.arange(len(BALLS)) * len(BALL[1])
    for name, start in zip(BALLS, starts, strict=True):
        alone = ao.bake(Mesh(*BALLS[name]), FALLOFF, 32, at="faces", both_sides=True)
        rows = slice(start, start + len(BALL[1]))
        assert np.array_equal(found["w"][rows], alone.w.astype("f4"))
        assert np.array_equal(found["w_below"][rows], alone.below.w.astype("f4"))
    report = json.loads((folder / "r.json").read_text())
    assert report["faces"] == len(BALLS) * len(BALL[1])
    assert 0 < report["rmse_estimate"] < 0.05
    baked("--occluded-by", "object", "--profile", output="p.npz")
    found = np.load("p.npz")
    check(found["w"], {name: by_hand(name)[name] for name in BALLS})
    assert math.isclose(found["radius"], scenes.load("m.obj").mesh.radius, rel_tol=1e-6)
    hat = ao.bake(Mesh(*BALLS["hat"]), ao.Exponential(half_distance=found["half_distances"][3]), 32)
    assert np.allclose(found["profile"][ROWS["hat"], 3], hat.w, atol=1e-5)


def test_a_texture_of_each_object_alone(folder):
    baked("--occluded-by", "object", "--size", "64", mesh="m.glb", output="<OBJECT>.exr")
    source = scenes.load("m.glb")
    part = source.parts[1]
    rows = source.mesh.faces[part.faces]
    mesh = Mesh(source.mesh.vertices, rows)
    expected = ao.bake_texture(mesh, source.uv[part.faces], 64, FALLOFF, 32).w.astype("f4")
    assert np.array_equal(read_image("hat.exr")[0]["beauty"][..., 0], expected)


def test_from_python(folder):
    source = scenes.load("m.obj", names=True)
    some = scenes.select_objects(source, receive=["hat"], exclude=("*_collision",))
    check(ao.bake(some.mesh, FALLOFF, 32, only=some.only).w.astype("f4"), by_hand("hat", occluders=["body", "shoe"]))
    with pytest.raises(OptionError, match="receive: expected a list of names or patterns, got 'hat'"):
        scenes.select_objects(source, receive="hat")
    with pytest.raises(OptionError, match="by: expected all, object or name"):
        scenes.select_objects(source, by="objects")


def test_a_batch_excludes_where_there_is_something_to_exclude(folder):
    (folder / "plain.obj").write_text((folder / "m.obj").read_text().replace("_collision", "_skin"))
    options = "--output-dir", "out", "--format", "npy", *FEW, "--exclude", "*_collision"
    succeeded("bake", "m.obj", "plain.obj", *options)
    rows = ROWS["body_collision"]
    assert (np.load("out/m.npy")[rows] == 1).all()
    assert (np.load("out/plain.npy")[rows] < 1).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--receive", "bdy"], "m.obj: receive: expected a name or pattern of its objects, body, hat, body_collision, "
         "shoe, got 'bdy'; did you mean body?"),
        (["--exclude", "!bag*"], "shoe, got '!bag*'"),
        (["--exclude", "*"], "m.obj: exclude: expected patterns that leave an object to bake, got *"),
        (["--receive", "hat", "--exclude", "h*"], "m.obj: receive: expected patterns that leave an object to bake"),
        (["--occluded-by", "object", "--occlusion", "texture", "-o", "t.glb"], "--occluded-by object does not go with "
         "textures in a .glb"),
        (["m.glb", "--occluded-by", "object"], "--occluded-by needs <OBJECT> in the name of an image"),
        (["--cast", "hat", "--high", "m.obj"], "--cast and --high exclude each other"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(folder, options, message):
    given = options if options[0] == "m.glb" else ["m.obj", "-o", "w.npy", *options]
    refused_without_a_trace(folder, [message], "bake", "-o", "w.png", *given)
