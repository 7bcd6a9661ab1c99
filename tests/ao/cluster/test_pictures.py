"""Pictures by real workers of a real scheduler: the bits of one process, textures that only one machine has, losses."""

from dataclasses import replace

import numpy as np
import pytest
from clusters import LEFT_SOCKETS, compiled_by, killed_in_mid_block, workers_at
from rendered import CAMERA, SMALL, box, still_scene

from obscurance.ao.cluster.pictures import render_on
from obscurance.raytrace import (
    AlphaSurface,
    EnvironmentLight,
    InputError,
    Lambert,
    Object,
    Opacity,
    Scene,
    Settings,
    Shape,
    SkyLight,
    render,
)
from obscurance.raytrace.image.texture import Texture
from obscurance.raytrace.image.write import write_image

pytestmark = LEFT_SOCKETS


def image(path):
    write_image(path, np.random.default_rng(1).random((8, 16, 3)).astype(np.float32))
    return path


def textured(path):
    """A floor and two instances of a box with a texture, in the light of a sky and of an image."""
    still, cube = still_scene(), box((0, 0, 0), (1, 1, 1), 1)
    shape = Shape(cube, Lambert(albedo=0.8), uv=cube.vertices[:, :2] + cube.vertices[:, 2:], texture=Texture(path))
    moved = np.eye(4)
    moved[:3, 3] = -1.5, -1.5, -0.7
    sky = SkyLight(zenith=(0.2, 0.4, 0.9), horizon=0.8, ground=0.2), EnvironmentLight(image=path, intensity=0.5)
    scene = Scene((still.objects[0], Object(shape, moved), Object(shape)), (*still.lights, *sky))
    count = len(scene.flattened().vertices)
    bent = np.random.default_rng(2).normal(size=(count, 3))
    return scene.with_obscurance(np.linspace(0, 1, count), bent / np.linalg.norm(bent, axis=1)[:, None])


def pierced(path):
    """The same with alpha: a box that is cut by the texture, and a glass one."""
    scene = textured(path)
    first, *boxes = scene.objects
    cut, glass = (
        Opacity.uniform(surface, box.shape.mesh.faces, box.shape.uv)
        for box, surface in zip(
            boxes, (AlphaSurface(texture=Texture(path), grey=True, cutoff=0.5), AlphaSurface(0.5)), strict=True
        )
    )
    made = [
        replace(box, shape=replace(box.shape, mesh=replace(box.shape.mesh, opacity=alpha)))
        for box, alpha in zip(boxes, (cut, glass), strict=True)
    ]
    return replace(scene, objects=(first, *made))


def still(_):
    return still_scene()


PICTURES = {
    "gouraud": (still, replace(SMALL, shading="gouraud", obscurance="ambient and diffuse")),
    "few samples, cropped": (still, replace(SMALL, samples=2, crop=(19, 7, 50, 40))),
    "alpha": (pierced, Settings(width=150, height=101, samples=9)),
    "textured": (textured, Settings(width=150, height=101, samples=9)),
}


def render_by(cluster, *picture, **options):
    """What workers render, in blocks of one tile, and how many there were."""
    with workers_at(cluster.scheduler_address, block_rays=1) as workers:
        return render_on(workers, *picture, **options), workers.blocks


@pytest.mark.parametrize("name", PICTURES)
def test_workers_make_the_bits_of_one_process(cluster, tmp_path, name):
    make, settings = PICTURES[name]
    scene = make(image(tmp_path / "paint.png"))
    alone, done = render(scene, CAMERA, settings), []  # at first: workers load its kernels
    frame, blocks = render_by(cluster, scene, CAMERA, settings, progress=lambda *tiles: done.append(tiles))
    for layer, values in alone.layers.items():
        assert np.array_equal(frame.layers[layer], values), layer
    assert (frame.rays, frame.rays_skipped) == (alone.rays, alone.rays_skipped)
    assert done == sorted(done)
    assert done[-1][0] == done[-1][1]
    assert (blocks > done[-1][1]) == (settings.samples > 4)  # tiles that are rendered again for their neighbours
    assert [path.name for path in tmp_path.iterdir()] == ["paint.png"]
    assert set(compiled_by(cluster)) == {()}


def test_the_beauty_alone_is_the_same(cluster):
    frame, _ = render_by(cluster, still_scene(), CAMERA, SMALL, layers=False)
    assert list(frame.layers) == ["beauty"]
    assert np.array_equal(frame.layers["beauty"], render(still_scene(), CAMERA, SMALL).layers["beauty"])


def test_a_texture_that_cannot_be_read_ends_the_picture_in_the_line_of_one_process(cluster, tmp_path):
    scene = textured(image(tmp_path / "paint.png"))
    lost = tmp_path / "lost.png"
    shape = replace(scene.objects[1].shape, texture=Texture(lost))
    scene = replace(scene, objects=(*scene.objects[:2], replace(scene.objects[2], shape=shape)))
    with pytest.raises(InputError, match=r"lost\.png: file: expected ") as alone:
        render(scene, CAMERA, SMALL)
    with pytest.raises(InputError) as ours:
        render_by(cluster, scene, CAMERA, SMALL)
    assert (str(ours.value), type(ours.value)) == (str(alone.value), type(alone.value))
    assert [path.name for path in tmp_path.iterdir()] == ["paint.png"]


def test_a_killed_worker_loses_only_the_tiles_that_it_had(cluster, tmp_path):
    with killed_in_mid_block(cluster, tmp_path, 1):
        frame, _ = render_by(cluster, still_scene(), CAMERA, SMALL)
    assert np.array_equal(frame.layers["beauty"], render(still_scene(), CAMERA, SMALL).layers["beauty"])
