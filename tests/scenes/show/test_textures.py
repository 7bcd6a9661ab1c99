"""What pages hold of textures."""

import numpy as np
from gltf_samples import half_textured
from pages import columns_of, facts_of

from obscurance.scenes.commands.view import view_results

CODES = np.random.default_rng(0).integers(0, 256, (4, 6), np.uint8)
UV = np.array([[-0.5, 1.5], [1, 1.5], [1, 0], [-0.5, 0]], "<f4")


def page_of(path, codes, **reference):
    path.write_bytes(half_textured(codes, UV, **reference))
    view_results(path, None, path.with_suffix(".html"), None, "y")
    return path.with_suffix(".html").read_bytes()


def texels_of(page, number=0):
    about = facts_of(page)["bakes"][number]["textures"][0]
    return np.cumsum(columns_of(page)[f"texels{number}.0"], dtype=np.uint8).reshape(about["height"], about["width"])


def test_texels_coordinates_and_modes_are_those_of_the_file(tmp_path):
    page = page_of(tmp_path / "t.glb", CODES)
    facts, columns = facts_of(page), columns_of(page)
    about = facts["bakes"][0]
    assert about["textures"] == [{"width": 6, "height": 4, "wrap": ["clamp_to_edge", "mirrored_repeat"]}]
    assert np.array_equal(texels_of(page), CODES)
    uv = columns["uv0"].reshape(-1, 2) * about["uvStep"] + about["uvLow"]
    assert np.allclose(uv[:4], UV, atol=2e-6)
    assert facts["draws"] == [[2, 0, -1], [2, -1, -1]]  # the last: images of base colours, of which there are none
    assert np.allclose(columns["w0"][4:] / 65535, 0.25, atol=1e-5)


def test_the_strength_of_a_texture_counts(tmp_path):
    page = page_of(tmp_path / "t.glb", CODES, strength=0.5)
    assert np.array_equal(texels_of(page), np.rint(255 * (1 + 0.5 * (CODES / 255 - 1))))


def test_a_large_texture_is_shrunk_by_means(tmp_path):
    codes = np.zeros((3, 4098), np.uint8)
    codes[:, ::2] = 200
    texels = texels_of(page_of(tmp_path / "t.glb", codes))
    assert texels.shape == (3, 1366)
    assert 60 < texels.min() <= texels.max() < 140
    assert abs(texels.mean() - 100) < 1
