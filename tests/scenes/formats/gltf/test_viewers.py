"""Outputs before the judgement of others: glTF's validator, and three.js in a browser (`make viewers`); also of
the mesh files in a folder that the variable MESHES names."""

import os
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import gltf_samples
import numpy as np
import pytest
import validator
from gltf_files import Builder
from gltf_samples import SAMPLES, quad, with_images
from uv_meshes import grid_charts

from benchmarks.pictures import browser
from obscurance.raytrace import AmbientLight, Camera, MeshError, Scene, Settings, render
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.asset.primitive import StoredBake
from obscurance.scenes.description.mesh_scene import placed, read_source
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import write
from obscurance.scenes.geometry.builtin_shapes import SOLIDS

validated = pytest.mark.skipif(validator.missing() is not None, reason=str(validator.missing()))
shown = pytest.mark.skipif(browser.missing() is not None, reason=str(browser.missing()))
OPTIONS = ({}, {"colors": "rgb"}, {"occlusion": "none"}, {"replace_occlusion": True})
SIZE = 160, 120
W = np.random.default_rng(0).random((16, 16)).astype(np.float32)
WAYS = (False, False), (True, False), (False, True)
FOLDER = os.environ.get("MESHES")
FILES = [path for path in sorted(Path(FOLDER).iterdir()) if path.suffix in (".glb", ".obj")] if FOLDER else []


def bake(count):
    return StoredBake(np.random.default_rng(count).random(count))


def outputs(folder, source, name):
    for number, options in enumerate(OPTIONS):
        target = folder / f"{name}-{number}.glb"
        write(target, bake(len(source.mesh.vertices)), source, **options)
        yield target


def textured(folder, source, name, ways=WAYS):
    """The source with its own coordinates, if it has some everywhere, and with new ones, by some options."""
    numbers = [grid_charts(len(source.mesh.faces))]
    with suppress(MeshError):
        numbers += [0] * (source.uv is not None)
    for uv in numbers:
        for replace, orm in ways:
            target = folder / f"{name}-{'own' if isinstance(uv, int) else 'new'}-{replace}-{orm}.glb"
            all_uv, odd = source.uv if isinstance(uv, int) else uv, np.zeros((len(source.mesh.faces), 1, 1), bool)
            for part in source.parts[1::2]:
                odd[part.faces] = True
            sets = [SimpleNamespace(w=W, uv=np.where(odd == which, all_uv, np.nan)) for which in (False, True)]
            rest = np.linspace(0, 1, len(source.mesh.vertices))
            target.write_bytes(textured_glb(source, sets, replace, orm, rest)[0])
            yield target


def faults(targets):
    return {path.name: found for path, found in zip(targets, validator.errors(*targets), strict=True) if found}


@validated
def test_the_validator_finds_no_error_in_outputs(tmp_path):
    targets = []
    for name, kind in SOLIDS.items():
        shape = Asset.of(kind().geometry().mesh)
        targets += [*outputs(tmp_path, shape, name), *textured(tmp_path, shape, name, WAYS[2:])]
    for name, make in SAMPLES.items():
        (tmp_path / f"{name}.glb").write_bytes(make())
        source = load(tmp_path / f"{name}.glb", "out.glb")
        targets += [*outputs(tmp_path, source, f"{name}-out"), *textured(tmp_path, source, name)]
    assert {"rough-own-False-True.glb", "occluded-own-True-False.glb"} <= {path.name for path in targets}
    assert faults(targets) == {}


@validated
@pytest.mark.skipif(not FILES, reason="the variable MESHES names no folder of meshes")
def test_the_validator_finds_no_error_in_textured_files(tmp_path):
    for file in FILES:
        targets = list(textured(tmp_path, load(file, "out.glb"), file.stem))
        before = len(validator.errors(file)[0]) if file.suffix == ".glb" else 0
        assert before or faults(targets) == {}, file.name


@validated
def test_the_validator_is_heard(tmp_path):
    data = SAMPLES["plain"]().replace(b'"indices"', b'"indicez"').replace(b'"count": 4', b'"count": 9')
    (tmp_path / "bad.glb").write_bytes(data)
    assert any("ACCESSOR" in line for line in validator.errors(tmp_path / "bad.glb")[0])


CORNER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [0, 0, 1]], "<f4")
CAMERA = Camera(position=(1.4, 1.1, 2.6), target=(0.5, 0.4, 0.3), up=(0, 1, 0), field_of_view=35.0)


def corner(folder):
    """A wall and a floor without material or texture coordinates, and w of their vertices as a ramp."""
    builder = Builder()
    builder.mesh(builder.primitive(CORNER, [[0, 1, 2], [0, 2, 3], [0, 5, 4], [0, 4, 1]], material=0))
    matt = {"pbrMetallicRoughness": {"metallicFactor": 0}}
    (folder / "in.glb").write_bytes(builder.glb([{"mesh": 0}], materials=[matt]))
    result = StoredBake(np.array([0.1, 0.5, 0.9, 0.6, 1, 0]))
    write(folder / "ramp.glb", result, load(folder / "in.glb", folder / "ramp.glb"))
    return folder / "ramp.glb"


def moved_texture(folder):
    """A texture of four greys, turned and moved, at part of its strength."""
    builder = Builder()
    primitive = quad(builder, 0, material=0)
    codes = np.zeros((2, 2, 3), np.uint8)
    codes[..., 0] = [[30, 100], [170, 240]]
    data = gltf_samples.encoded(np.repeat(np.repeat(codes, 32, axis=0), 32, axis=1))
    builder.mesh(primitive)
    moved = {"offset": [0.25, 0.125], "rotation": 0.4, "scale": [0.75, 0.75]}
    reference = {"index": 0, "strength": 0.8, "extensions": {"KHR_texture_transform": moved}}
    material = {"pbrMetallicRoughness": {"metallicFactor": 0}, "occlusionTexture": reference}
    used = {"extensionsUsed": ["KHR_texture_transform"]}
    images = with_images(builder, data)
    (folder / "moved.glb").write_bytes(builder.glb([{"mesh": 0}], materials=[material], **used, **images))
    return folder / "moved.glb"


@shown
@pytest.mark.parametrize("made", [corner, moved_texture])
def test_a_browser_shows_the_obscurance_that_our_renderer_does(tmp_path, made):
    """White under ambient light alone is w. Pixels at edges are left out: two filters and rasterisers differ there."""
    file = made(tmp_path)
    objects = [item for item, _ in placed(read_source(file))]
    frame = render(Scene(objects, (AmbientLight(intensity=(1, 1, 1)),)), CAMERA, Settings(*SIZE, samples=16))
    ours = frame.layers["beauty"][..., 0]
    (theirs,) = browser.shown([file], CAMERA, SIZE)
    smooth = np.ones(ours.shape, bool)
    for axis in (0, 1):
        for step in (-2, -1, 1, 2):
            smooth &= np.abs(np.roll(ours, step, axis) - ours) < 0.03
    inside = smooth & (frame.layers["object_id"][..., 0] > 0)
    assert inside.sum() > 1500
    assert np.ptp(ours[inside]) > 0.5
    assert np.abs(ours - theirs[..., 0])[inside].max() < 0.02
    assert np.abs(ours - theirs[..., 0])[inside].mean() < 0.004
