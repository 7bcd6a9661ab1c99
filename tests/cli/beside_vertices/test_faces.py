"""`--at faces` and `--both-sides` by the command."""

import json

import numpy as np
import pytest
from command import obscurance

QUADS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nf 1 2 3 4\nf 1 5 6 2\n"


@pytest.fixture
def quads(tmp_path, monkeypatch):
    (tmp_path / "quads.obj").write_text(QUADS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bake(*options):
    return obscurance("bake", "quads.obj", "--at", "faces", "--falloff", "binary", "--samples", 4096, *options)


def test_arrays_have_a_row_a_triangle_and_ply_a_property_of_polygons(quads):
    done = bake("-o", "w.npz", "--both-sides")
    assert "4 faces" in done.stdout, done.stderr
    arrays = np.load("w.npz")
    assert arrays["w"].shape == arrays["w_below"].shape == (4,)
    assert (arrays["w_below"] == 1).all()
    assert bake("-o", "w.npy", "-q", "--both-sides").returncode == 0
    assert np.array_equal(np.load("w.npy"), np.stack([arrays["w"], arrays["w_below"]], axis=1))
    assert bake("-o", "w.ply", "-q", "--both-sides").returncode == 0
    header, body = (quads / "w.ply").read_bytes().split(b"end_header\n")
    lines = header.decode().splitlines()
    assert lines[lines.index("element face 2") :][2:4] == [
        "property float obscurance",
        "property float obscurance_below",
    ]
    assert b"obscurance" not in header[header.index(b"element vertex") : header.index(b"element face")]
    left = [("error", "<f4"), ("flags", "u1"), ("bent", "<f4", 3)]
    row = np.dtype([("n", "u1"), ("v", "<i4", 4), ("w", "<f4", 2), ("grey", "u1", 3), *left])
    rows = np.frombuffer(body[-2 * row.itemsize :], row)
    assert np.abs(rows["w"] - np.stack([arrays["w"].reshape(2, 2).mean(axis=1), [1, 1]], axis=1)).max() < 1e-6
    assert np.abs(rows["error"] - arrays["error"].reshape(2, 2).mean(axis=1)).max() < 1e-6
    assert np.array_equal(rows["flags"], np.bitwise_or.reduce(arrays["flags"].reshape(2, 2), axis=1))
    bent = arrays["bent_normals"].reshape(2, 2, 3).sum(axis=1)
    assert np.abs(rows["bent"] - bent / np.linalg.norm(bent, axis=1, keepdims=True)).max() < 1e-5


def test_reports_count_faces_and_show_one_grey_on_each(quads):
    for name in ("r.json", "r.html"):
        assert bake("-o", "w.npy", "-q", "--report", name).returncode == 0
    report, w = json.loads((quads / "r.json").read_text()), np.load("w.npy")
    assert report["faces"] == len(w) == 4
    assert "vertices" not in report
    assert report["w"]["least"] == pytest.approx(w.min(), abs=1e-6)
    page = (quads / "r.html").read_text()
    assert "4 faces" in page
    assert page.count("data:image/png") == 3
