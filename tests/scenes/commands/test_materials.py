"""`obscurance materials`: presets listed and written."""

import tomllib

import pytest
from command import obscurance, refused, succeeded

from obscurance.raytrace import material_from_dict
from obscurance.raytrace.brdf.presets import PRESETS
from obscurance.scenes.commands.materials import preset_toml


def test_the_presets_are_listed():
    result = succeeded("materials")
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(PRESETS)


@pytest.mark.parametrize("name", PRESETS)
def test_a_written_preset_is_the_preset(name):
    (table,) = tomllib.loads(preset_toml(name))["materials"]
    assert table.pop("name") == f"my_{name}"
    assert material_from_dict(table) == material_from_dict({"preset": name})


def test_a_written_preset_has_no_digits_of_rounding():
    assert "k_a = [1.0, 0.71, 0.29]" in preset_toml("gold")


def test_names_that_are_none(tmp_path):
    refused(obscurance("materials", "glod"), "did you mean gold?", "materials NAME")
    refused(obscurance("materials", tmp_path / "gone.toml"), "one of brushed_aluminium")


def test_measuring_is_done_in_python():
    refused(obscurance("materials", "gold", "--check"), "materials --check: expected albedo(material, angle) and")
