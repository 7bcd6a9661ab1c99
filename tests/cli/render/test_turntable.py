"""`obscurance render --turntable`, and the light of scenes that have none."""

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from meshes import two_boxes
from scene_files import write_ball

from obscurance import scenes
from obscurance.raytrace import Mesh, Settings, render
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.description.mesh_scene import mesh_scene
from obscurance.scenes.description.obscurance import with_obscurance
from obscurance.scenes.description.read import read_scene

SMALL = Settings(64, 48, samples=4)


def described(made, settings=SMALL):
    return mesh_scene(scenes.Asset.of(made), settings)


def test_frames_are_pictures_of_the_cameras_on_one_turn(tmp_path):
    trimesh.Trimesh(*two_boxes(), process=False).export(tmp_path / "boxes.ply")
    options = "--width", 64, "--height", 48, "--samples", 4
    done = succeeded("render", tmp_path / "boxes.ply", "-o", tmp_path / "turn.exr", *options, "--turntable", 3)
    names = [f"turn_000{number}.exr" for number in (1, 2, 3)]
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == names
    assert [line.split(":")[0].split("/")[-1] for line in done.stdout.splitlines()] == names
    frames = [read_image(tmp_path / name)[0] for name in names]
    views = read_scene(tmp_path / "boxes.ply", (64, 48)).turntable(3)
    for frame, view in zip(frames, views, strict=True):
        scene, _ = with_obscurance(view)
        alone = render(scene, view.camera, SMALL)
        np.testing.assert_array_equal(frame["beauty"], alone.layers["beauty"].astype(np.float32))
    assert np.abs(frames[0]["beauty"] - frames[1]["beauty"]).mean() > 0.01


@pytest.mark.parametrize("up", ["y", "z", "-x"])
def test_the_camera_stays_as_far_and_as_high_and_sees_all(up):
    view = described(Mesh(*two_boxes(), up=up))
    centre, axis = view.scene.flattened().centre, np.array(view.camera.up)
    away = np.array([np.subtract(turned.camera.position, centre) for turned in view.turntable(8)])
    np.testing.assert_allclose(away @ axis, (away @ axis)[0], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), np.linalg.norm(away[0]), rtol=1e-9)
    angles = [np.dot(np.cross(a, b), axis) for a, b in zip(away, np.roll(away, -1, axis=0), strict=True)]
    np.testing.assert_allclose(angles, angles[0], rtol=1e-6)  # equal steps, one way
    for turned in view.turntable(8):
        border = render(turned.scene, turned.camera, SMALL, layers=False).layers["beauty"][..., 3].copy()
        border[1:-1, 1:-1] = 0
        assert not border.any()


def test_lights_of_a_scene_stay_and_our_own_turn(tmp_path):
    own = read_scene(write_ball(tmp_path)).turntable(2)
    assert own[0].scene.lights == own[1].scene.lights
    assert own[0].camera == read_scene(write_ball(tmp_path)).camera
    ours = described(Mesh(*two_boxes())).turntable(2)
    assert ours[0].scene.lights != ours[1].scene.lights
    keys = [view.scene.lights[0].direction @ np.array(view.camera.axes()).T for view in ours]
    np.testing.assert_allclose(*keys, atol=1e-12)


def test_refusals_leave_nothing(tmp_path):
    scene = write_ball(tmp_path)
    target = "-o", tmp_path / "turn.png", "--turntable"
    refused(obscurance("render", scene, *target, 0), "turntable: expected a number of pictures, at least 1, got 0")
    refused(obscurance("render", scene, *target, 2, "--report", tmp_path / "r.json"), "--turntable", "--report")
    assert list(tmp_path.iterdir()) == [scene]


def test_pictures_without_lights_of_their_own_show_occlusion():
    view = described(scenes.Sponge(level=2, fineness=0.06).geometry().mesh)
    lit, _ = with_obscurance(view)
    pictures = [render(scene, view.camera, SMALL, layers=False).layers["beauty"] for scene in (lit, view.scene)]
    off = np.subtract(*(encode_srgb(picture[..., :3].clip(0, 1)) for picture in pictures), dtype=float)
    assert -10 * np.log10(np.mean(off**2)) < 30  # decibels
