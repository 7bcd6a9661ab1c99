"""`obscurance check`: what it says of w in files of ours and of others, right, wrong and stale."""

import json

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from mesh_files import obj
from meshes import hills
from uv_meshes import FLOOR_AND_WALL

from obscurance import ao
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.image.write import linear_png
from obscurance.raytrace.mesh.mesh import Mesh, shape_hash
from obscurance.scenes.bake.record import Record
from obscurance.scenes.formats.load import load


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(24)))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*words):
    """The facts of a check, and its exit status."""
    done = obscurance("check", *words, "--json")
    assert done.returncode < 2, done.stderr
    (facts,) = json.loads(done.stdout)
    return facts, done.returncode


@pytest.fixture(scope="module")
def exact():
    """w of the hills to .0005, by 2^16 rays a vertex."""
    return ao.bake(hills(24), "binary", 1 << 16, denoise=False).w


def test_w_that_is_right_has_no_error_and_noise_of_a_known_size_is_measured(folder, exact):
    np.save("w.npy", exact)
    falloff = "--falloff", "binary"
    right, status = found("w.npy", "--of", "hills.obj", *falloff, "--within", 0.004)
    assert (status, right["rmse"] < 0.003) == (0, True), right  # one estimate alone would scatter by .011
    assert abs(right["mean_error"]) < 4 * right["mean_error_standard_error"]
    rng = np.random.default_rng(5)
    np.save("noisy.npy", np.clip(exact + rng.normal(scale=0.03, size=exact.shape), 0, 1))
    noisy, status = found("noisy.npy", "--of", "hills.obj", *falloff, "--within", 0.02)
    size = np.sqrt(np.mean((np.load("noisy.npy") - exact) ** 2))
    assert status == 1
    assert abs(noisy["rmse"] - size) < 3 * noisy["rmse_standard_error"], noisy
    np.save("darker.npy", np.clip(exact - 0.05, 0, 1))
    darker, _ = found("darker.npy", "--of", "hills.obj", *falloff)
    assert darker["mean_error"] == pytest.approx(-0.05, abs=0.003)


@pytest.mark.parametrize("name", ["w.ply", "w.glb", "w.npz", "w.png", "w.exr"])
def test_files_of_ours_say_how_they_were_baked(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.obj").write_text(FLOOR_AND_WALL)
    options = "--half-distance", "30%", "--ground", "auto", "--normals", "area"
    succeeded("bake", "room.obj", "-o", name, *options, "--samples", 4096, "--up", "z", *sized(name))
    record = record_of(tmp_path / name)
    assert record.options.items() >= {"half_distance": "30%", "ground": "auto", "normals": "area", "up": "z"}.items()
    right, _ = found(name, "--of", "room.obj", "--within", 0.05)
    assert (right["falloff"], right["stale"]) == ("exponential, half distance 30%", False)
    other, _ = found(name, "--of", "room.obj", "--falloff", "binary")
    assert 3 * right["rmse"] < other["rmse"], (right, other)


def record_of(path):
    return Record.read(path, load(path) if path.suffix in (".ply", ".glb") else None)


def sized(name):
    return ("--size", "64") if name.endswith(("png", "exr")) else ()


def test_another_falloff_of_a_profile_is_named(folder):
    succeeded("bake", "hills.obj", "-o", "w.glb", "--profile", "--tau", "2", "--tolerance", 0.02)
    succeeded("falloff", "w.glb", "--half-distance", "10%", "-o", "w.ply")
    facts, _ = found("w.ply")
    assert facts["falloff"] == "exponential, half distance 10%"
    assert facts["rmse"] < 0.03
    succeeded("falloff", "w.glb", "--half-distance", "10%,40%", "-o", "product.npz")
    assert record_of(folder / "product.npz") is None


def test_a_mesh_that_is_another_is_stale(folder):
    succeeded("bake", "hills.obj", "-o", "w.npz", "--tolerance", 0.02)
    vertices, faces = hills(24)
    order = np.random.default_rng(1).permutation(len(faces))
    trimesh.Trimesh(vertices.astype(np.float32), faces[order], process=False).export("same.ply")
    assert found("w.npz", "--of", "same.ply")[0]["stale"] is False
    vertices[40, 2] += 0.01
    (folder / "moved.obj").write_bytes(obj(vertices, faces))
    assert found("w.npz", "--of", "moved.obj")[0]["stale"] is True
    (folder / "fewer.obj").write_bytes(obj(*hills(20)))
    done = obscurance("check", "w.npz", "--of", "fewer.obj")
    assert (done.returncode, "stale: the mesh is not the one that was baked" in done.stdout) == (1, True)


def test_hashes_are_those_of_shapes():
    vertices, faces = hills(6)
    whole = shape_hash(Mesh(vertices, faces))
    assert shape_hash(Mesh(vertices[::-1], len(vertices) - 1 - faces[::-1])) == whole
    assert shape_hash(Mesh(vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))) == whole
    assert shape_hash(Mesh(vertices, np.roll(faces, 1, axis=1))) == whole
    assert shape_hash(Mesh(vertices, faces[:, ::-1])) != whole
    assert shape_hash(Mesh(vertices, faces[1:])) != whole
    assert shape_hash(Mesh(vertices[:, [1, 0, 2]], faces)) != whole


def rays_by_hand(mesh, reach, count=256, seed=3, is_even=False):
    """Ambient occlusion as many write it: trimesh's rays by Embree, cosine-weighted, or even, over the hemisphere; hits
    nearer than `reach` close."""
    rng = np.random.default_rng(seed)
    n = mesh.vertex_normals
    t = np.cross(n, np.where(np.abs(n[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]]))
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    b = np.cross(n, t)
    w = np.ones(len(n))
    for _ in range(count):
        u, v = rng.random((2, len(n), 1))
        u = u * (2 - u) if is_even else u  # sin² of the angle
        direction = np.sqrt(u) * (np.cos(2 * np.pi * v) * t + np.sin(2 * np.pi * v) * b) + np.sqrt(1 - u) * n
        places, rows, _ = mesh.ray.intersects_location(mesh.vertices + 1e-4 * n, direction, multiple_hits=False)
        w[rows[np.linalg.norm(places - mesh.vertices[rows], axis=1) < reach]] -= 1 / count
    return w


@pytest.mark.parametrize("encoding", ["linear", "sRGB"])
def test_a_bake_of_others_is_recognised(folder, encoding):
    mesh = trimesh.Trimesh(*hills(24), process=False)
    w = rays_by_hand(mesh, 0.5 * ao.prepare((mesh.vertices, mesh.faces)).radius)
    codes = np.rint(255 * (w if encoding == "linear" else encode_srgb(w))).astype(np.uint8)
    mesh.visual.vertex_colors = np.repeat(codes[:, None], 4, axis=1) | [0, 0, 0, 255]
    for name in ("by_hand.ply", "by_hand.glb"):
        mesh.export(name)
        facts, status = found(name, "--within", 0.05)
        assert status == 0
        assert facts["meaning"] == f"grey, {encoding}"
        form, length = facts["falloff"].rsplit(" ", 1)
        assert form == "binary, max distance"
        assert float(length.rstrip("%")) == pytest.approx(50, rel=0.08)
        assert facts["rmse"] == pytest.approx(np.sqrt(np.mean(w * (1 - w)) / 256), rel=0.35)
        assert min(facts["rmse_by_other_falloffs"].values()) > 1.3 * facts["rmse"]


def test_rays_that_are_even_are_recognised(folder):
    mesh = trimesh.Trimesh(*hills(24), process=False)
    np.save("even.npy", rays_by_hand(mesh, np.inf, is_even=True))
    facts, _ = found("even.npy", "--of", "hills.obj")
    assert facts["falloff"] == "binary, by solid angle"
    assert facts["rmse"] < 0.03


def test_textures_of_others_are_looked_up_on_the_faces(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.obj").write_text(FLOOR_AND_WALL)
    succeeded("bake", "room.obj", "-o", "w.exr", "--falloff", "binary", "--size", 128, "--samples", 1024)
    from obscurance.raytrace.image.read import read_image

    w = read_image("w.exr")[0]["beauty"][:, :, :1]
    (tmp_path / "srgb.png").write_bytes(linear_png(np.rint(255 * encode_srgb(w)).astype(np.uint8)))
    facts, _ = found("srgb.png", "--of", "room.obj")
    assert (facts["meaning"], facts["falloff"], facts["at"]) == ("sRGB", "binary", "surface")
    assert facts["rmse"] < 0.03
    (tmp_path / "upside_down.png").write_bytes(linear_png(np.rint(255 * w[::-1]).astype(np.uint8)))
    assert found("upside_down.png", "--of", "room.obj", "--within", 0.1)[1] == 1


def test_objects_and_places_with_the_largest_errors_come_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = trimesh.Scene()
    for name, at in (("near", 0.0), ("far", 3.0)):
        scene.add_geometry(trimesh.Trimesh(*hills(16), process=False), geom_name=name, node_name=name,
                           transform=trimesh.transformations.translation_matrix([at, 0, 0]))  # fmt: skip
    scene.export("two.glb")
    succeeded("bake", "two.glb", "-o", "w.npz", "--falloff", "binary", "--samples", 4096)
    w = np.load("w.npz")["w"]
    w[:256] = np.clip(w[:256] - 0.1, 0, 1)
    w[300] = 0
    np.save("wrong.npy", w)
    facts, _ = found("wrong.npy", "--of", "two.glb", "--falloff", "binary")
    first, second = facts["objects"].items()
    assert first[0] == "near", facts["objects"]
    assert first[1] == pytest.approx(0.1, abs=0.02)
    assert second[1] < 0.06
    assert facts["worst"][0]["vertex"] == 300
    assert facts["worst"][0]["at"] == pytest.approx([*hills(16)[0][44] + [3, 0, 0]], abs=1e-6)
    done = obscurance("check", "wrong.npy", "--of", "two.glb", "--falloff", "binary", "--within", 0.01)
    assert "objects      near 0." in done.stdout
    assert "worst        vertex 300 at (" in done.stdout
    assert "within 0.01  no: at least 0.0" in done.stdout


@pytest.mark.parametrize(
    "options", [("--at", "faces"), ("--method", "surface"), ("--occluded-by", "object"), ("--flip",), ()]
)
def test_every_kind_of_w_is_checked(folder, options):
    succeeded("bake", "hills.obj", "-o", "w.ply", "--falloff", "binary", *options)
    facts, status = found("w.ply", "--within", 0.05)
    assert (status, facts["falloff"]) == (0, "binary")
    assert facts["at"] == {"faces": "faces", "surface": "surface"}.get("".join(options[1:]), "vertices")
    np.testing.assert_array_less(facts["rmse"], 0.03)


def test_clouds_and_pictures_of_other_programs_are_checked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ball = trimesh.creation.icosphere(subdivisions=3).vertices
    points = np.concatenate([ball, 0.5 * ball + [1.6, 0, 0]])
    rows = np.column_stack([points, np.concatenate([ball, ball])])
    head = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    lines = "\n".join(" ".join(map(str, row)) for row in rows)
    (tmp_path / "cloud.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n{head}end_header\n{lines}\n"
    )
    for name, of in (("w.ply", ()), ("w.npz", ("--of", "cloud.ply"))):
        succeeded("bake", "cloud.ply", "-o", name, "--points", "--falloff", "binary", "--tolerance", 0.02)
        facts, _ = found(name, *of)
        assert (facts["at"], facts["rmse"] < 0.05) == ("points", True), facts
    (tmp_path / "room.obj").write_text(FLOOR_AND_WALL)
    succeeded("bake", "room.obj", "-o", "w.exr", "--falloff", "binary", "--size", 128, "--samples", 1024)
    from obscurance.raytrace.image.read import read_image
    from obscurance.raytrace.image.write import write_image

    write_image("w.jpg", read_image("w.exr")[0]["beauty"][:, :, :1])
    facts, _ = found("w.jpg", "--of", "room.obj")
    assert (facts["meaning"], facts["falloff"], facts["rmse"] < 0.03) == ("sRGB", "binary", True), facts


def test_arrays_of_faces_are_known_by_their_number(folder):
    succeeded("bake", "hills.obj", "-o", "w.npy", "--falloff", "binary", "--at", "faces")
    facts, _ = found("w.npy", "--of", "hills.obj", "--falloff", "binary")
    assert (facts["at"], facts["rmse"] < 0.03) == ("faces", True)


def test_a_page_shows_the_difference(folder, exact):
    np.save("w.npy", np.clip(exact - 0.2, 0, 1))
    done = obscurance("check", "w.npy", "--of", "hills.obj", "--falloff", "binary", "-o", "page.html")
    assert done.returncode == 0, done.stderr
    page = (folder / "page.html").read_text()
    assert "check of w.npy" in page
    assert "by independent rays" in page


def test_what_is_no_bake_is_refused(folder, exact):
    np.save("w.npy", exact)
    np.save("short.npy", exact[:5])
    (folder / "damaged.npz").write_text("no archive")
    for words, *expected in (
        (["hills.obj"], "hills.obj: w: expected w as obscurance bake writes it, vertex colours or", "got none"),
        (["w.npy"], "check --of: expected --of with the mesh that w.npy belongs to, got none"),
        (["short.npy", "--of", "hills.obj"], "expected a value for each of the 576 vertices of hills.obj, got 5"),
        (["w.npy", "--of", "hills.obj", "--within", "0"], "check --within: expected a number above 0"),
        (["w.npy", "--of", "hills.obj", "-o", "page.png"], "check --output", ".html"),
        (["none.npy", "--of", "hills.obj"], "none.npy"),
        (["damaged.npz", "--of", "hills.obj"], "damaged.npz: content: expected a complete and valid NPZ file"),
        (["w.npy", "--of", "hills.obj", "--half-distance", "x"], "check --half-distance"),
    ):
        refused(obscurance("check", *words), *expected)
