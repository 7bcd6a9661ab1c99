"""`obscurance view` and pages as output of a bake: what becomes of files, and what careless users read."""

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from mesh_files import obj
from meshes import hills, two_boxes
from pages import columns_of, facts_of

from obscurance.raytrace.errors import SceneError
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import read_w

BAKE = "--samples", 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("view")
    (made / "hills.obj").write_bytes(obj(*hills()))
    (made / "boxes.obj").write_bytes(obj(*two_boxes()))
    for target in ("w.npy", "w.npz", "w.ply", "w.glb", "w.html"):
        succeeded("bake", made / "hills.obj", "-o", made / target, *BAKE)
    succeeded("bake", made / "boxes.obj", "-o", made / "boxes.ply", *BAKE)
    vertices, faces = hills()
    (made / "moved.obj").write_bytes(obj(vertices + np.array([0.1, 0, 0]), faces))
    succeeded("bake", made / "moved.obj", "-o", made / "moved.ply", *BAKE)
    (made / "turned.obj").write_bytes(obj(vertices, faces[:, ::-1]))
    succeeded("bake", made / "turned.obj", "-o", made / "turned.ply", *BAKE)
    return made


@pytest.mark.parametrize("name", ["w.npy", "w.npz", "w.ply", "w.glb"])
def test_every_baked_file_becomes_a_page_beside_it(folder, tmp_path, name):
    result = tmp_path / name
    result.write_bytes((folder / name).read_bytes())
    mesh = ("--mesh", folder / "hills.obj") if name.startswith("w.np") else ()
    done = succeeded("view", result, *mesh)
    w = load(result).w if name == "w.glb" else np.load(folder / "w.npy")
    assert f"{tmp_path / 'w.html'}: {len(w)} vertices" in done.stdout
    page = (tmp_path / "w.html").read_bytes()
    assert abs(columns_of(page)["w0"] / 65535 - w).max() <= 1 / 65535
    assert ("error0" in columns_of(page)) == (name != "w.npy")
    assert facts_of(page)["title"] == name


def test_a_bake_writes_the_page_of_its_npz(folder, tmp_path):
    for name in ("w.npz", "w.html"):  # by one axis, which all sides of hard edges have in common
        obscurance("bake", folder / "hills.obj", "-o", tmp_path / name, "--normals", "up", *BAKE)
    obscurance("view", tmp_path / "w.npz", "--mesh", folder / "hills.obj", "-o", tmp_path / "p.html", "--quiet")
    baked, viewed = ((tmp_path / "w.html").read_bytes(), (tmp_path / "p.html").read_bytes())
    for name, column in columns_of(viewed).items():
        np.testing.assert_array_equal(columns_of(baked)[name], column)
    assert facts_of(baked)["title"] == "hills.obj"


@pytest.mark.parametrize("order", [("boxes.ply", "boxes.glb"), ("boxes.glb", "boxes.ply")])
def test_a_glb_that_repeats_vertices_at_creases_is_the_same_mesh(folder, tmp_path, order):
    succeeded("bake", folder / "boxes.obj", "-o", folder / "boxes.glb", *BAKE)
    boxes = load(folder / "boxes.ply")
    count = len(boxes.mesh.vertices)
    assert len(load(folder / "boxes.glb").mesh.vertices) > count
    done = obscurance("view", *(folder / name for name in order), "-o", tmp_path / "two.html")
    assert f"{count} vertices" in done.stdout, done.stderr
    columns = columns_of((tmp_path / "two.html").read_bytes())
    stored = {name: load(folder / name).w[:count] for name in order}
    for number, name in enumerate(order):
        assert abs(columns[f"w{number}"] / 65535 - stored[name]).max() <= 1 / 65535
    assert len(columns["w0"]) == count
    np.testing.assert_array_equal(read_w(folder / "boxes.glb", count), np.float64(stored["boxes.glb"]))
    with pytest.raises(SceneError, match="one a vertex of the scene"):
        read_w(folder / "boxes.glb", count - 1)


def test_arrays_by_columns_are_read_as_such(folder, tmp_path):
    with np.load(folder / "w.npz") as held:
        by_columns = {name: np.asfortranarray(array) for name, array in held.items()}
    np.savez(tmp_path / "f.npz", **by_columns)
    for path in (folder / "w.npz", tmp_path / "f.npz"):
        obscurance("view", path, "--mesh", folder / "hills.obj", "-o", tmp_path / f"{path.stem}.html")
    columns = [columns_of((tmp_path / name).read_bytes()) for name in ("w.html", "f.html")]
    np.testing.assert_array_equal(columns[0]["bent0"], columns[1]["bent0"])


def test_the_up_axis_is_that_of_the_format_or_the_one_given(folder, tmp_path):
    target = tmp_path / "p.html"
    for options, up in (((), "y"), (("--up", "z"), "z"), (("--up", "-x"), "-x")):
        succeeded("view", folder / "w.ply", "-o", target, *options)
        assert facts_of(target.read_bytes())["up"] == up


def test_a_bake_turns_its_page_and_its_report_as_asked(folder, tmp_path):
    line = "bake", folder / "hills.obj", "-o", tmp_path / "p.html", *BAKE, "--up", "z"
    succeeded(*line)
    assert facts_of((tmp_path / "p.html").read_bytes())["up"] == "z"
    reports = []
    for up in ("y", "z"):
        line = "bake", folder / "hills.obj", "-o", tmp_path / "w.npy", *BAKE, "--report", tmp_path / f"{up}.html"
        succeeded(*line, "--up", up)
        reports.append((tmp_path / f"{up}.html").read_text().partition("base64,")[2][:4000])
    assert reports[0] != reports[1]


def test_two_bakes_are_named_and_their_mesh_comes_from_either(folder, tmp_path):
    for results in (("w.npz", "w.ply"), ("w.ply", "w.npy")):
        succeeded("view", *(folder / name for name in results), "-o", tmp_path / "p.html")
        assert [bake["name"] for bake in facts_of((tmp_path / "p.html").read_bytes())["bakes"]] == list(results)
    succeeded("view", folder / "w.ply", folder / "w.glb")
    assert (folder / "w-w.html").exists()


def test_open_shows_the_page_in_the_browser(folder, tmp_path, shown_in_browser):
    done = obscurance("view", folder / "w.ply", "-o", tmp_path / "p.html", "--open", "--quiet")
    assert (done.returncode, done.stdout) == (0, "")
    assert shown_in_browser == [(tmp_path / "p.html").as_uri()]


def test_a_page_is_replaced_but_no_other_html_file(folder, tmp_path):
    target = tmp_path / "p.html"
    for _ in range(2):
        succeeded("view", folder / "w.ply", "-o", target)
    target.write_text("<html>mine</html>")
    refused(obscurance("view", folder / "w.ply", "-o", target), "view --output", "a page of obscurance to replace")
    refused(obscurance("bake", folder / "hills.obj", "-o", target), "bake --output", "a page of obscurance to replace")
    assert target.read_text() == "<html>mine</html>"


@pytest.mark.parametrize("name", ["hills.obj", "plain.ply", "plain.glb"])
def test_a_mesh_without_w_is_baked_for_a_look(folder, tmp_path, name):
    mesh = trimesh.Trimesh(*hills(4), process=False)
    mesh.export(tmp_path / name)
    done = succeeded("view", tmp_path / name)
    assert f"obscurance: {tmp_path / name}: there is no w in it; it was baked with --tolerance 0.02" in done.stderr
    assert b"obscurance" in (tmp_path / name).with_suffix(".html").read_bytes()
    refused(obscurance("view", tmp_path / name, "-o", tmp_path / "p.png"), "output", ".html")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("w.ply", "hills.obj"), ("view OTHER", "a baked file", "hills.obj")),
        (("w.npz",), ("view --mesh", "the mesh that w.npz belongs to", "got none")),
        (("w.npz", "w.npy"), ("view --mesh",)),
        (("w.ply", "-o", "p.png"), ("view --output", ".html", "p.png")),
        (("none.ply",), ("none.ply", "an existing file")),
        (("w.npz", "--mesh", "boxes.obj"), ("w.npz: w", "16 values")),
        (("w.ply", "boxes.ply"), ("w.ply: vertices", "the 16 of", "got 64")),
        (("w.ply", "moved.ply"), ("moved.ply: vertices", "others, up to 0.1")),
        (("w.ply", "turned.ply"), ("turned.ply: faces", "others")),
        (("w.ply", "--mesh", "boxes.obj"), ("w.ply: vertices", "the 16 of")),
        (("w.ply", "--up", "w"), ("view --up",)),
        (("plain.ply", "w.ply"), ("plain.ply: w: expected obscurance at every vertex", "got none")),
        (("broken.npz", "--mesh", "hills.obj"), ("broken.npz",)),
        (("short.npz", "--mesh", "hills.obj"), ("short.npz: error", "64")),
        (("objects.npz", "--mesh", "hills.obj"), ("objects.npz", "flags", "numbers")),
        (("wrong.npz", "--mesh", "hills.obj"), ("wrong.npz", "error", "numbers in [0, 100]")),
    ],
)
def test_what_is_no_bake_is_refused_in_one_line(folder, tmp_path, arguments, words):
    w = load(folder / "w.ply").w
    header, data = (folder / "w.ply").read_bytes().split(b"end_header\n")
    (folder / "plain.ply").write_bytes(header.replace(b" obscurance\n", b" other\n") + b"end_header\n" + data)
    (folder / "broken.npz").write_bytes((folder / "w.npz").read_bytes()[:300])
    np.savez(folder / "short.npz", w=w, error=w[:5])
    np.savez(folder / "wrong.npz", w=w, error=-w)
    np.savez(folder / "objects.npz", w=w, flags=np.array([None] * 64))
    known = {path.name for path in folder.iterdir()} | {"none.ply"}
    line = [folder / word if word in known else tmp_path / word if word == "p.png" else word for word in arguments]
    before = sorted(folder.iterdir())
    refused(obscurance("view", *line), *words)
    assert sorted(folder.iterdir()) == before
