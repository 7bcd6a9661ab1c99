"""`obscurance bench` and the reference it judges by."""

import json

import numpy as np
from command import succeeded
from mesh_files import obj

from obscurance import ao
from obscurance.ao import Binary, Exponential
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.commands.bench import bench_table, run_bench
from obscurance.scenes.geometry.polyhedra import icosphere
from obscurance.scenes.validation.reference import reference


def room(half=1.0):
    """An axis-aligned cube, every vertex in a corner."""
    corners = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return Mesh(corners, [[q[i], q[j], q[k]] for q in quads for i, j, k in ((0, 1, 2), (0, 2, 3))])


def test_the_reference_knows_open_and_closed():
    sphere = Mesh(*icosphere(2))
    inside = Mesh(sphere.vertices, sphere.faces[:, ::-1])
    tau = 0.8
    mus = [each.resolve(1.0) for each in (Binary(), Binary(0.5), Exponential(tau=tau))]
    assert (reference(sphere, mus, rays=256).w == 1).all()
    w = reference(inside, mus, rays=4096).w
    a = 2 * tau  # inside a sphere: 1 − 2 (1 − (1 + a) e^(−a)) / a², a = 2τR
    assert (w[0] < 1e-3).all()
    assert np.abs(w[2] - (1 - 2 * (1 - (1 + a) * np.exp(-a)) / a**2)).max() < 0.02  # the icosphere is not a sphere
    assert (w[0] <= w[1]).all()


def test_the_reference_is_not_the_estimator_but_agrees_with_it():
    mesh = Mesh(*icosphere(3))
    dented = Mesh(mesh.vertices * (1 + 0.3 * np.sin(5 * mesh.vertices[:, :1])), mesh.faces)
    for falloff in (Binary(), Exponential(max_distance="40%")):
        truth = reference(dented, [falloff.resolve(dented.radius)], rays=4096, vertices=300)
        assert len(truth.vertices) == 300
        baked = ao.bake(dented, falloff, samples=4096).w[truth.vertices]
        difference = baked - truth.w[0]
        assert 0 < np.sqrt(np.mean(difference**2)) < 2e-3
    alone, together = (reference(dented, [falloff.resolve(1.0)], 256, vertices=300, threads=count) for count in (1, 2))
    assert (alone.w == together.w).all()


def test_bench_finds_less_error_with_more_rays():
    mesh = Mesh(*icosphere(2))
    dented = Mesh(mesh.vertices * (1 + 0.3 * np.sin(5 * mesh.vertices[:, :1])), mesh.faces)
    rows = run_bench(dented, Binary(), samples=(16, 256), rounds=2)
    assert rows[1].errors.rmse < rows[0].errors.rmse / 3
    assert all(0.5 < row.estimate / row.errors.rmse < 2 for row in rows)
    assert [len(row.seconds) for row in rows] == [2, 2]
    assert len(bench_table(rows).splitlines()) == 3


def test_the_command_prints_a_table_and_writes_a_report(tmp_path):
    mesh = room()
    source = tmp_path / "room.obj"
    source.write_bytes(obj(mesh.vertices, mesh.faces))
    result = succeeded("bench", source, "--falloff", "binary", "--report", tmp_path / "r.json")
    assert "8 vertices, 12 faces" in result.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert [row["samples"] for row in report["rows"]] == [16, 64, 256, 1024]
    assert report["options"]["falloff"] == "binary"
    assert report["versions"]["embree"]
