"""A mesh whose file names no up axis, and that has a flat base across z alone, is said to lie on its side."""

import numpy as np
import pytest
from command import obscurance
from mesh_files import ply

from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.warnings import lying_notes
from obscurance.scenes.geometry.polyhedra import icosphere

PYRAMID = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1.5)])
SIDES = np.array([(1, 0, 2), (2, 0, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])


def test_a_base_across_z_alone_is_noticed():
    (line,) = lying_notes(Mesh(PYRAMID, SIDES, source="p.ply"))
    assert line == "p.ply: y is taken for up, but the mesh seems to lie on its side: --up z"


@pytest.mark.parametrize(
    "mesh",
    [
        Mesh(PYRAMID, SIDES, up="z"),
        Mesh(PYRAMID[:, [0, 2, 1]], SIDES[:, ::-1]),
        Mesh(*icosphere(2)),
        Mesh(PYRAMID[:4], SIDES[:2]),
    ],
    ids=["the file says z", "a base across y", "no base", "flat"],
)
def test_others_are_not(mesh):
    assert lying_notes(mesh) == []


def test_commands_say_it_where_up_matters(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.ply").write_bytes(ply(PYRAMID, SIDES))
    few = "--samples", 16
    said = "p.ply: y is taken for up, but the mesh seems to lie on its side: --up z"
    for line in (("w.glb",), ("w.npy", "--ground", "auto"), ("w.html",)):
        assert said in obscurance("bake", "p.ply", "-o", *line, *few).stderr
        assert said not in obscurance("bake", "p.ply", "-o", *line, *few, "--up", "z").stderr
    assert said not in obscurance("bake", "p.ply", "-o", "w.npy", *few).stderr
    picture = "render", "p.ply", "-o", "p.png", "--width", 16, "--height", 16, *few
    assert said in obscurance(*picture).stderr
    assert said not in obscurance(*picture, "--up", "z").stderr
    assert said in obscurance("view", "w.npy", "--mesh", "p.ply", "-o", "v.html").stdout
