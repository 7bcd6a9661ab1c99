"""Outputs in Blender, which `make peers` installs: where w is, and which of them darken a picture."""

import json
import subprocess
import sys

import numpy as np
import pytest
from command import succeeded
from mesh_files import obj
from project import ROOT

from obscurance import ao
from obscurance.raytrace.mesh.mesh import Mesh

BLENDER = ROOT / ".peers" / "blender" / "bin" / "python"
PRESET = "--preset", "blender"
OUTPUTS = {"plain.glb": (*PRESET, "--occlusion", "none"), "ramp.glb": (*PRESET, "--occlusion", "ramp"),
           "colors.glb": PRESET, "w.ply": (), "w.npy": ()}  # fmt: skip


def floor_and_wall(side=9):
    """A floor, y = 0, and a wall at its back, z = -1."""
    x, t = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.stack([first, first + 1, first + side + 1, first, first + side + 1, first + side], 1).reshape(-1, 3)
    vertices = np.concatenate([np.stack([x, 0 * x, -t], 1), np.stack([x, t, 0 * x - 1], 1)])
    return vertices, np.concatenate([faces, faces + side * side])


@pytest.mark.slow
@pytest.mark.skipif(not BLENDER.exists(), reason="no Blender: make peers")
def test_blender_has_w_and_its_pictures_darken_by_colours(tmp_path):
    vertices, faces = floor_and_wall()
    (tmp_path / "corner.obj").write_bytes(obj(vertices, faces))
    for name, options in OUTPUTS.items():
        done = succeeded("bake", tmp_path / "corner.obj", "-o", tmp_path / name, "--samples", 256, *options)
    names = [str(tmp_path / name) for name in OUTPUTS if name != "w.npy"]
    script = ROOT / "tests" / "helpers" / "gltf" / "in_blender.py"
    done = subprocess.run([BLENDER, script, *names], capture_output=True, text=True, check=True)
    plain, ramp, colours, ply = json.loads(done.stdout.splitlines()[-1])

    w = np.load(tmp_path / "w.npy")
    np.testing.assert_allclose(ply["places"], vertices, atol=1e-6)
    np.testing.assert_allclose(ply["obscurance"], w, atol=1e-6)
    np.testing.assert_allclose(ply["Col"], w, atol=0.005)  # of eight bits, sRGB-encoded
    for glb in (plain, ramp, colours):
        np.testing.assert_allclose(glb["places"], vertices[:, [0, 2, 1]] * [1, -1, 1], atol=1e-6)  # z is up there
        np.testing.assert_allclose(glb["_OBSCURANCE"], w, atol=1e-6)
    np.testing.assert_allclose(colours["Color"], w[colours["corners"]], atol=0.008)  # eight bits twice
    assert plain["Color"] is ramp["Color"] is None
    assert ramp["brightness"] == pytest.approx(plain["brightness"], rel=1e-3)
    seen = w[: len(w) // 2].mean()
    assert plain["brightness"] * (seen - 0.1) < colours["brightness"] < plain["brightness"] * (seen + 0.04)


@pytest.mark.slow
@pytest.mark.skipif(not BLENDER.exists(), reason="no Blender: make peers")
def test_the_extension_bakes_what_the_command_does(tmp_path):
    script = ROOT / "tests" / "helpers" / "gltf" / "in_extension.py"
    command = tmp_path / "obscurance"
    command.write_text(f'#!/bin/sh\nexec {sys.executable} {ROOT / "cli.py"} "$@"\n')
    command.chmod(0o755)
    done = subprocess.run([BLENDER, script, ROOT / "blender", command], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert [found[name] for name in ("alone", "among", "image")] == ["FINISHED"] * 3

    monkey = found["monkey"]
    turned = np.array(monkey["faces"])[:, ::-1]  # the object is mirrored
    mesh = Mesh(monkey["places"], turned, monkey["normals"], up="z")
    floor = np.array([(-4, -4, -1.5), (4, -4, -1.5), (4, 4, -1.5), (-4, 4, -1.5)]), np.array([(0, 1, 2), (0, 2, 3)])
    for w, occluders in ((monkey["w"], []), (found["among w"], [floor])):
        exact = ao.bake(mesh, "binary", 8192, occluders=occluders).w
        assert np.sqrt(np.mean((w - exact) ** 2)) < 0.007
    centres = (np.arange(64) + 0.5) / 64 * 8 - 4
    x, y = (axis.ravel() for axis in np.meshgrid(centres, centres))
    places = np.stack([x, y, np.full_like(x, -1.5)], axis=1)
    exact = ao.bake_points(floor, places, np.tile([0.0, 0, 1], (len(x), 1)), falloff="binary", occluders=[mesh]).w
    assert np.sqrt(np.mean((np.ravel(found["pixels"]) - exact) ** 2)) < 0.01
    assert exact.min() < 0.3

    assert found["node"] is True
    assert "its modifiers change its faces: apply them, or bake into an image" in found["modified"]
    assert "bake --half-distance: expected a length above 0" in found["wrong"]
    keys = [found[key] for key in ("X", "LEFTMOUSE", "MIDDLEMOUSE", "ESC")]  # what is baked cannot be edited meanwhile
    assert keys == ["RUNNING_MODAL", "RUNNING_MODAL", "PASS_THROUGH", "CANCELLED"]
    assert not found["panel"]
    assert found["long"] == "FINISHED"
    assert "obscurance ended with 0" in found["nothing"]
    assert "Exec format error" in found["no program"]
    assert "Suzanne: expected finite coordinates, got others" in found["nan"]
    assert found["left"] == []
