"""What a notebook shows of a bake: a picture, or the HTML of whoever offers some."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from meshes import hills, two_boxes

from obscurance import ao
from obscurance.raytrace import Camera, Mesh
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.mesh.normals import face_normals


def pixels(tmp_path, png):
    (tmp_path / "shown.png").write_bytes(png)
    return read_image(tmp_path / "shown.png")[0]["beauty"]


def test_a_bake_is_a_picture_of_w_on_its_mesh(tmp_path):
    """Codes of sRGB are w, darker where the surface turns away from the camera."""
    baked = ao.bake(Mesh(*two_boxes()), "binary", samples=64)
    open_, half = (
        pixels(tmp_path, replace(baked, w=np.full(len(baked.w), grey))._repr_png_())[..., 0] for grey in (1.0, 0.5)
    )
    shown = pixels(tmp_path, baked._repr_png_())
    assert shown.shape[:2] == (360, 480)
    seen = open_ > 0.2
    assert 0.1 < seen.mean() < 0.9
    normals = face_normals(baked.mesh.vertices, baked.mesh.faces)[0]
    facing = -(normals @ Camera.framing(baked.mesh, aspect=4 / 3).axes()[2]).min()
    assert open_.max() == pytest.approx(0.6 + 0.4 * facing, abs=0.01)
    assert np.median(half[seen] / open_[seen]) == pytest.approx(decode_srgb(0.5), abs=0.01)
    assert (shown[seen, 0] <= open_[seen]).all()
    np.testing.assert_array_equal(shown[..., 0], shown[..., 1])


def test_w_of_a_fine_mesh_is_shown_on_the_coarse_one(tmp_path):
    coarse, fine = Mesh(*hills(4)), Mesh(*hills(12))
    baked = ao.bake(coarse, samples=8, high=fine, cage=1.0)
    assert baked.mesh is coarse
    assert pixels(tmp_path, baked._repr_png_()).shape[:2] == (360, 480)


def test_a_texture_is_its_page(tmp_path):
    vertices, faces = two_boxes()
    baked = ao.bake_texture((vertices, faces), vertices[:, :2] % 1, 16, samples=16)
    assert baked._repr_png_().startswith(b"\x89PNG")
    assert pixels(tmp_path, baked._repr_png_()).shape[:2] == (16, 16)


def test_html_is_left_to_whoever_offers_it(entry_points):
    baked = ao.bake(Mesh(*two_boxes()), samples=8)
    assert baked._repr_html_() is None
    entry_points["obscurance.html"] = [SimpleNamespace(load=lambda: lambda bake: f"<p>{len(bake.w)}</p>")]
    assert baked._repr_html_() == "<p>16</p>"
