"""`--points`: clouds of points by the command."""

from pathlib import Path

import numpy as np
import pytest
from command import succeeded


def write_cloud(path, points, normals=None):
    names = ["x", "y", "z", *(("nx", "ny", "nz") if normals is not None else ()), "label"]
    rows = np.column_stack([points, *([normals] if normals is not None else []), np.arange(len(points))])
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *(f"property float {name}" for name in names)]
    path.write_text("\n".join([*head, "end_header", *(" ".join(map(repr, row)) for row in rows.tolist())]) + "\n")


@pytest.fixture
def ball(tmp_path, monkeypatch):
    """A ball of points, and a wall beside it."""
    monkeypatch.chdir(tmp_path)
    points = np.random.default_rng(4).normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    write_cloud(tmp_path / "ball.ply", points, points)
    (tmp_path / "wall.obj").write_text("v -2 -99 -99\nv -2 99 -99\nv -2 99 99\nv -2 -99 99\nf 1 2 3 4\n")
    return points


def test_points_occlude_each_other_and_keep_what_they_have(ball):
    done = succeeded("bake", "ball.ply", "-o", "w.ply", "--points", "--falloff", "binary", "--samples", 64)
    assert "2,000 points" in done.stdout
    head = Path("w.ply").read_bytes()[:800]
    assert b"property float label" in head
    assert b"property float obscurance" in head
    assert b"element face" not in head
    succeeded("bake", "ball.ply", "-o", "w.npy", "--points", "--samples", 64, "-q")
    assert np.load("w.npy").shape == (2000,)


def test_beside_an_occluder_they_are_samples_alone(ball):
    command = ("bake", "ball.ply", "-o", "w.npy", "--points", "--falloff", "binary", "--samples", 256, "-q")
    succeeded(*command, "--occluder", "wall.obj")
    w = np.load("w.npy")
    assert w[ball[:, 0] < -0.97].mean() < 0.1
    assert (w[ball[:, 0] > 0.9] > 0.9).all()
    succeeded("bake", "ball.ply", "-o", "dry.npy", "--points", "--dry-run")
