"""`obscurance materials`: presets listed and written, figures that are right."""

import tomllib

import numpy as np
import pytest
from command import obscurance, refused

from raytrace.materials.materials import (
    CookTorrance,
    EllipticalBeckmann,
    Lambert,
    OrenNayar,
    Phong,
    material_from_dict,
)
from raytrace.materials.presets import PRESETS
from raytrace.materials.reflect import asymmetry, directional_albedo
from scenes.commands.materials import albedo, check, fit_error, preset_toml


def test_the_presets_are_listed():
    result = obscurance("materials")
    assert result.returncode == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(PRESETS)


@pytest.mark.parametrize("name", PRESETS)
def test_a_written_preset_is_the_preset(name):
    (table,) = tomllib.loads(preset_toml(name))["materials"]
    assert table.pop("name") == f"my_{name}"
    assert material_from_dict(table) == material_from_dict({"preset": name})


def test_a_written_preset_has_no_digits_of_rounding():
    assert "k_a = [1.0, 0.71, 0.29]" in preset_toml("gold")


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.5])
def test_albedo_of_what_is_known(angle):
    np.testing.assert_allclose(albedo(Lambert(albedo=(0.2, 0.5, 1)), angle), [0.2, 0.5, 1], rtol=1e-9)
    np.testing.assert_allclose(albedo(Phong(k_d=0.6), angle), 0.6, rtol=1e-9)
    mixed = CookTorrance(albedo=0.4, k_s=0.5, m=0.5, eta=1.5)
    np.testing.assert_allclose(albedo(mixed, angle), directional_albedo(mixed, angle, order=400), rtol=2e-3)
    mirror = CookTorrance(albedo=0, k_s=1, m=1e-4, eta=1e6)
    np.testing.assert_allclose(albedo(mirror, min(angle, 1.0)), 1, rtol=1e-4)


@pytest.fixture
def coarse(monkeypatch):
    """Figures of a quadrature with a tenth of the points: texts that don't show its last digits."""
    monkeypatch.setattr("scenes.commands.materials._ORDER", 120)


def test_along_and_across_the_grain(coarse):
    text = check("brush", EllipticalBeckmann(albedo=0, k_s=1, m_parallel=0.1, m_perpendicular=0.4, eta=20))
    assert "along all" in text
    assert "across all" in text
    assert "reciprocal" in text
    assert "not reciprocal" not in text


def test_figures_of_a_preset_and_of_a_scene(tmp_path, coarse):
    result = obscurance("materials", "--check", "clay")
    assert result.returncode == 0
    assert "integral" in result.stdout
    scene = tmp_path / "scene.toml"
    red = '{ model = "phong", k_d = [0.5, 0.25, 0.125], k_s = 0.5 }'
    box = f'[[objects]]\nbuiltin = "box"\nmaterial = {red}\n'
    scene.write_text(box + box + '[[objects]]\nname = "moon"\nbuiltin = "sphere"\nmaterial = "moon"\n')
    result = obscurance("materials", scene, "--check")
    assert result.returncode == 0
    blocks = result.stdout.split("\n\n")
    assert [block.split(":")[0] for block in blocks] == ["box, box", "moon"]
    assert "not reciprocal" in blocks[0]
    assert "red" in blocks[0]


def test_the_error_of_the_fit_is_the_one_documented():
    rms, largest = fit_error(OrenNayar(albedo=0.9, sigma=0.5))  # docs/models/oren_nayar.md has .027 and .173
    assert rms == pytest.approx(0.027, abs=0.006)
    assert largest == pytest.approx(0.173, abs=0.02)


def test_black_is_reciprocal():
    assert asymmetry(Lambert(albedo=0)) == 0


def test_names_that_are_none(tmp_path):
    refused(obscurance("materials", "glod"), "did you mean gold?", "materials NAME")
    refused(obscurance("materials", "glod", "--check"), "did you mean gold?")
    refused(obscurance("materials", tmp_path / "gone.toml", "--check"), "existing file")
    refused(obscurance("materials", tmp_path / "gone.toml"), "one of brushed_aluminium")
