"""`obscurance render`, `scenes` and `compare` as commands: what is asked for is what the files hold."""

import json

import numpy as np
import pytest
import trimesh
from command import obscurance, succeeded
from gltf_files import Builder
from scene_files import SMALL, write_ball

from obscurance.ao.report import versions
from obscurance.raytrace.image.formats import FORMATS
from obscurance.raytrace.image.frame import LAYERS
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.library import BUILTIN, builtin_toml


def rendered(scene, output, *options):
    """Layers of the picture of a scene, 48×32 unless `options` say otherwise."""
    succeeded("render", scene, "-o", output, *SMALL, *options)
    return read_image(output)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("ball")


@pytest.fixture(scope="module")
def scene(folder):
    return write_ball(folder)


@pytest.fixture(scope="module")
def whole(scene, folder):
    """The picture that the others are compared with, and its report, made on one thread."""
    return rendered(scene, folder / "whole.exr", "--report", folder / "whole.json", "--threads", 1)


def test_the_scenes_are_listed():
    result = succeeded("scenes")
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(BUILTIN)
    assert obscurance("scenes", "cornell").stdout == builtin_toml("cornell")


@pytest.mark.parametrize("ending", FORMATS)
def test_every_ending_with_its_metadata(tmp_path, scene, ending):
    target = tmp_path / f"picture{ending}"
    result = succeeded("render", scene, "-o", target, *SMALL, "--obscurance", "off", "--seed", 7)
    assert target.name in result.stdout
    layers, metadata = read_image(target)
    assert layers["beauty"].shape[:2] == (32, 48)
    assert set(layers) == (set(LAYERS) if ending == ".exr" else {"beauty"})
    assert metadata == {
        "scene": "ball.toml",
        "version": versions()["obscurance"],
        "samples": "4",
        "seed": "7",
        "shading": "phong",
        "normals": "file",
        "obscurance": "off",
    }
    assert list(tmp_path.iterdir()) == [target]


def test_a_preview_is_small_and_cheap(scene, folder, whole):
    report = folder / "preview.json"
    size = ("--width", 96, "--height", 64, "--samples", 64)
    assert rendered(scene, folder / "preview.exr", *size, "--preview", "--report", report)["beauty"].shape[:2] == (
        16,
        24,
    )
    preview, full = (json.loads((folder / f"{name}.json").read_text())["rays"] for name in ("preview", "whole"))
    assert preview["primary"] <= 24 * 16 * 4
    assert preview["bake"] < full["bake"]


def test_without_shadows(scene, folder, whole):
    report = folder / "lit.json"
    layers = rendered(scene, folder / "lit.exr", "--no-shadows", "--report", report)
    assert layers["shadow"].min() == 1
    assert json.loads(report.read_text())["rays"]["shadow"] == 0
    assert layers["beauty"].sum() > whole["beauty"].sum()


def test_the_report_holds_the_contract(whole, folder):
    found = json.loads((folder / "whole.json").read_text())
    made = {"scene", "settings", "layers", "picture", "rays", "rays_skipped", "seconds"}
    asked = {"schema_version", "kind", "verdict", "warnings", "command", "inputs", "options", "versions"}
    assert set(found) == made | asked | {"rmse_estimate", "error_calibration"}
    assert {"width": 48, "height": 32, "samples": 4, "shading": "phong", "threads": 1}.items() <= found[
        "settings"
    ].items()
    assert set(found["rays"]) == {"primary", "shadow", "bake"}
    assert found["rays"]["primary"] == 48 * 32 * 4
    reasons = {"behind", "unreached", "black", "culled", "unobstructed", "background", "primary_agreed"}
    assert reasons <= set(found["rays_skipped"])
    assert found["rays"]["shadow"] + sum(found["rays_skipped"][reason] for reason in reasons) == 48 * 32 * 4
    assert set(found["seconds"]) == {"bake", "build", "render", "write"}
    assert 0 < found["rmse_estimate"] < 0.05


def test_a_mesh_alone_and_its_baked_file(tmp_path):
    mesh = tmp_path / "ring.ply"
    trimesh.creation.torus(0.5, 0.2).export(mesh)
    alone = rendered(mesh, tmp_path / "alone.exr")
    assert 0.1 < alone["beauty"][..., 3].mean() < 0.9
    succeeded("bake", mesh, "-o", tmp_path / "w.npy", "--no-denoise")
    table = '[[objects]]\nmesh = "ring.ply"\n'
    (tmp_path / "now.toml").write_text(table)
    (tmp_path / "then.toml").write_text(f'[obscurance]\nbaked = "w.npy"\n{table}')
    now, then = (rendered(tmp_path / f"{name}.toml", tmp_path / f"{name}.exr") for name in ("now", "then"))
    assert now["obscurance"].min() < 0.9
    for name in ("obscurance", "beauty"):
        np.testing.assert_allclose(then[name], now[name], rtol=2e-7, atol=2e-7)  # the file holds float32


def test_a_glb_with_its_camera_and_light(tmp_path):
    builder = Builder()
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype="<f4")
    builder.mesh(builder.primitive(square, [0, 1, 2, 0, 2, 3]))
    nodes = [
        {"mesh": 0},
        {"camera": 0, "translation": [0, 0, 1]},
        {"translation": [0, 0, 2], "extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]
    lamp = {"type": "point", "intensity": 4.0, "color": [1.0, 0.5, 0.0]}
    cameras = [{"type": "perspective", "perspective": {"yfov": 0.2, "znear": 0.1}}]
    content = builder.glb(nodes, cameras=cameras, extensions={"KHR_lights_punctual": {"lights": [lamp]}})
    (tmp_path / "square.glb").write_bytes(content)
    layers = rendered(tmp_path / "square.glb", tmp_path / "square.exr")
    assert layers["beauty"][..., 3].min() == 1
    colour = layers["beauty"][16, 24]
    assert colour[0] > 0.1
    np.testing.assert_allclose(colour[:3] / colour[0], [1, 0.5, 0], atol=1e-6)


def test_compare(tmp_path, scene, folder, whole):
    same = succeeded("compare", folder / "whole.exr", folder / "whole.exr", "--threshold", 0)
    figures = dict(line.split() for line in same.stdout.splitlines())
    assert figures == {"mean_error": "0", "rms_error": "0", "max_error": "0", "psnr": "inf", "flip": "0"}
    other = tmp_path / "other.png"
    rendered(scene, other, "--no-shadows", "--obscurance", "off")
    pair, found = (folder / "whole.exr", other), tmp_path / "flip.png"
    succeeded("compare", *pair)
    different = obscurance("compare", *pair, "--threshold", 0.001, "--difference", found)
    assert different.returncode == 1
    assert float(dict(line.split() for line in different.stdout.splitlines())["flip"]) > 0.001
    assert read_image(found)[0]["beauty"].shape == (32, 48, 3)
    succeeded("compare", *pair, "--threshold", 10, "--metric", "max")
