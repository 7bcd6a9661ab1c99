"""`--points`: clouds of points by the command."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded


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


def coloured(path, points, normals):
    """Write a cloud with colours as scanners store them; returns these (k, 3)."""
    colours = np.random.default_rng(5).integers(0, 256, (len(points), 3))
    names = [*(f"float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")), "uchar red", "uchar green", "uchar blue"]
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *(f"property {name}" for name in names)]
    rows = zip(np.hstack([points, normals]).tolist(), colours.tolist(), strict=True)
    lines = (" ".join(map(repr, [*place, *colour])) for place, colour in rows)
    path.write_text("\n".join([*head, "end_header", *lines]) + "\n")
    return colours


def colours_of(path):
    vertex = trimesh.load(path, process=False)
    return np.asarray(vertex.colors)[:, :3]


def test_colours_of_a_cloud_are_kept_unless_others_are_asked_for(ball):
    colours = coloured(Path("scan.ply"), ball, ball)
    done = succeeded("bake", "scan.ply", "-o", "w.ply", "--points", "--samples", 4)
    assert "keeps the colours" in done.stderr
    assert (colours_of("w.ply") == colours).all()
    succeeded("bake", "scan.ply", "-o", "grey.ply", "--points", "--samples", 4, "--colors")
    grey = colours_of("grey.ply")
    assert (grey == grey[:, :1]).all()
    succeeded("bake", "grey.ply", "-o", "again.ply", "--points", "--samples", 4)  # that grey is w and no colour
    assert (colours_of("again.ply") == colours_of("grey.ply")).all()


def test_points_without_normals_are_named_so_and_their_discs_are_not_warned_of(ball):
    normals = ball.copy()
    normals[::50] = 0
    write_cloud(Path("some.ply"), ball, normals)
    done = succeeded("bake", "some.ply", "-o", "w.npy", "--points", "--samples", 4)
    assert "40 of 2,000 points have no normal" in done.stdout
    assert "uncertain" not in done.stderr
    for occluder in ((), ("--occluder", "wall.obj")):
        write_cloud(Path("splats.ply"), ball, np.zeros_like(ball))
        failed = obscurance("bake", "splats.ply", "-o", "w.npy", "--points", *occluder)
        refused(failed, "splats.ply: normals: expected some that are neither zero nor NaN, got none of 2,000")
    places = ball.copy()
    places[[7, 9]] = np.nan
    write_cloud(Path("holes.ply"), places, ball)
    failed = obscurance("bake", "holes.ply", "-o", "w.npy", "--points")
    refused(failed, "holes.ply: points[7]: expected finite coordinates, got [nan nan nan] (2 such)")


def test_one_point_can_be_a_probe(ball):
    write_cloud(Path("one.ply"), ball[:1], ball[:1])
    succeeded("bake", "one.ply", "-o", "w.npy", "--points", "--occluder", "wall.obj", "--samples", 16)
    assert np.load("w.npy").shape == (1,)
    failed = obscurance("bake", "one.ply", "-o", "x.npy", "--points")
    refused(failed, "one.ply: points: expected at least two, or --occluder, got 1")


@pytest.mark.parametrize("ending", [".ply", ".npz"])
def test_a_cloud_has_other_half_distances_later(ball, ending):
    succeeded("bake", "ball.ply", "-o", f"w{ending}", "--points", "--samples", 16, "--profile")
    mesh = ("--mesh", "ball.ply") if ending == ".npz" else ()
    succeeded("falloff", f"w{ending}", "--half-distance", "5%", "-o", "near.ply", *mesh)
    succeeded("falloff", f"w{ending}", "--half-distance", "5%", "-o", "near.npy")
    near = trimesh.load("near.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    assert (near["obscurance"] == np.load("near.npy")).all()
    assert (near["label"] == np.arange(len(ball))).all()
    refused(
        obscurance("falloff", f"w{ending}", "--half-distance", "5%", "-o", "w.glb", *mesh), ".npz or .ply, of points"
    )
