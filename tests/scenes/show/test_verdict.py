"""Verdicts: what is suspicious is noticed, and warnings are passed on."""

import hashlib
from pathlib import Path

import pytest

from obscurance.ao import Flag
from obscurance.scenes.bake.options import BAKE, RENDER
from obscurance.scenes.bake.report import command_line
from obscurance.scenes.show.report.verdict import flags_in_words, hashed, verdict

W = {"least": 0.1, "quantiles": {"0.5": 0.8}}
GOOD = {"w": W, "rmse_estimate": 0.004, "options": {}, "error_calibration": None, "warnings": [], "vertices": 9}
SEEN = {"picture": {"covered": 0.4, "brightest": 0.8, "clipped": 0.0}, "rmse_estimate": None, "warnings": []}


@pytest.mark.parametrize(
    ("report", "change", "level", "words"),
    [
        (GOOD, {}, "good", "RMSE of w is 0.004"),
        (GOOD, {"rmse_estimate": 0.03}, "note", "noise may show"),
        (GOOD, {"options": {"tolerance": 0.01}}, "good", "tolerance of 0.01 is met"),
        (GOOD, {"options": {"tolerance": 0.001}}, "bad", "tolerance of 0.001 is not met"),
        (GOOD, {"w": W | {"least": 1.0}}, "bad", "Nothing occludes"),
        (GOOD, {"w": W | {"quantiles": {"0.5": 0.01}}}, "bad", "inside out"),
        (GOOD, {"flagged": {"hidden": 2}}, "note", "2 of 9 vertices lie inside solids"),
        (
            GOOD,
            {"flagged": {"hidden": 2}, "rays_skipped": {"hidden": 64}},
            "note",
            "inside solids; w, the openness, is taken from",
        ),
        (GOOD, {"flagged": {"hidden": 1}}, "note", "One vertex lies inside solids"),
        (GOOD, {"warnings": ["m.ply: normals of 3 of 9 vertices are uncertain by 2°"]}, "note", "uncertain by"),
        (GOOD, {"warnings": ["w: between the vertices w, the openness, errs by 0.06, …"]}, "bad", "errs by 0.06"),
        (SEEN, {}, "good", "The picture was made"),
        (SEEN, {"picture": SEEN["picture"] | {"covered": 0.0}}, "bad", "Nothing is in view"),
        (SEEN, {"picture": SEEN["picture"] | {"brightest": 0.0}}, "bad", "black"),
        (SEEN, {"picture": SEEN["picture"] | {"clipped": 0.5}}, "note", "50% of the pixels"),
        (SEEN, {"rmse_estimate": 0.1}, "note", "in view is 0.1"),
    ],
)
def test_what_is_suspicious_is_said_first(report, change, level, words):
    found = verdict(report | change)
    assert found["good"] == (level != "bad")
    assert found["findings"][0]["level"] == level
    assert any(words in each["what"] and each["level"] == level for each in found["findings"])


def test_errors_larger_than_estimated_are_noticed():
    group = {"estimated": 0.001, "measured": 0.003, "low": 0.0025, "high": 0.004}
    assert "0.003 were measured" in str(verdict(GOOD | {"error_calibration": {"groups": [group]}}))
    assert "measured" not in str(verdict(GOOD | {"error_calibration": {"groups": [group | {"low": 0.0015}]}}))


@pytest.mark.parametrize("flag", list(Flag))
def test_every_flag_has_words_for_one_vertex_and_for_several(flag):
    name = flag.name.lower()
    (one,), (two,) = (flags_in_words({name: count}, 9, {}, "vertices").values() for count in (1, 2))
    assert one.startswith("One vertex ")
    assert two.startswith("2 of 9 vertices ")
    assert " they " not in one


def test_pages_of_a_texture_are_judged_each():
    found = verdict({"pages": {"a.png": GOOD, "b.png": GOOD | {"rmse_estimate": 0.03}}})
    assert found["findings"][0]["what"].startswith("b.png: ")
    assert len(found["findings"]) == 2


def test_standard_streams_are_so_in_the_command_and_have_a_hash():
    line = command_line("bake", BAKE, {"mesh": "<stdin>.ply", "output": "<stdout>.npy", "seed": 3})
    assert line == "obscurance bake - --input-format ply --output - --format npy --seed 3"
    (found,) = hashed([Path("<stdin>.ply")], {Path("<stdin>.ply"): b"ply"})
    assert (found["bytes"], found["sha256"]) == (3, hashlib.sha256(b"ply").hexdigest())


def test_a_command_line_has_the_options_that_differ_from_nothing():
    options = {"mesh": "a b.ply", "output": "w.npy", "tau": None, "denoise": False, "orm": True, "half": False}
    line = command_line("bake", BAKE, {**options, "threads": 2})
    assert line == "obscurance bake 'a b.ply' --output w.npy --no-denoise --orm"
    options = {"scene": "s.toml", "own_occlusion": True, "shadows": False}
    assert command_line("render", RENDER, options) == "obscurance render s.toml --no-shadows"
