"""Verdicts: every warning of the project has a remedy of its own, and what is suspicious is noticed."""

import hashlib
from pathlib import Path

import pytest

from ao import Flag
from scenes.commands.render import RENDER
from scenes.jobs.options import BAKE, command_line
from scenes.show.report.verdict import flags_in_words, hashed, remedy, verdict

WARNINGS = [
    "m.ply: normals of 3 of 9 vertices are uncertain by 2° (median): its coordinates as stored have steps of 1,"
    " too coarse for the faces there",
    "tolerance 0.01 is not met, the estimated RMSE is 0.02",
    "o.glb: not kept from m.obj: polygons, which become triangles",
    "o.ply: keeps the colours of m.ply; w is in its property obscurance alone",
    "o.glb: keeps the occlusion textures of 1 of 2 primitives, whose w viewers do not show; --replace-occlusion",
    "o.glb: uses the set TEXCOORD_2; not every viewer reads more than 2",
    "m.obj: 1 polygon crosses itself: no triangles between the corners fill what does",
    "m.obj: 2 polygons cross themselves: no triangles between the corners fill what does",
    "t.png: faces overlap in 3.0% of the covered texels",
    "t.png: 3 faces reach out of the unit square and are taken modulo 1",
    "t.png: 3 faces reach out of the unit square; <UDIM> in the output's name would keep tiles apart",
    "w.ply: between the vertices w errs by 0.10, the faces are too large for it: -o NAME.png, or smaller faces",
    "m.obj: 3 faces, of lid (steel), have no texture coordinates and get no texels; --uv fill makes some for them",
    "t.png: 3 points are not within the cage of the fine mesh and take the closest of it",
    "t.png: 3 faces have no area in texture space, and no texels",
]
PARTS = (
    ("raytrace/mesh/precision.py", "too coarse for the faces there"),
    ("ao/estimate/tolerance.py", "is not met, the estimated RMSE"),
    ("scenes/formats/unsupported.py", "not kept from"),
    ("scenes/formats/unsupported.py", "keeps the colours of"),
    ("scenes/formats/gltf/write.py", "keeps the occlusion textures of"),
    ("scenes/formats/gltf/write.py", "uses the set TEXCOORD_"),
    ("scenes/geometry/polygons.py", "crosses itself"),
    ("scenes/jobs/console.py", "between the vertices w errs by"),
    ("scenes/jobs/textures/pages.py", "faces overlap in"),
    ("scenes/jobs/textures/pages.py", "reach out of the unit square"),
    ("scenes/jobs/textures/pages.py", "would keep tiles apart"),
    ("scenes/jobs/textures/pages.py", "have no texture coordinates"),
    ("scenes/jobs/textures/pages.py", "are not within the cage"),
    ("scenes/jobs/textures/pages.py", "have no area in texture space"),
)
W = {"least": 0.1, "quantiles": {"0.5": 0.8}}
GOOD = {"w": W, "rmse_estimate": 0.004, "options": {}, "error_calibration": None, "warnings": [], "vertices": 9}
SEEN = {"picture": {"covered": 0.4, "brightest": 0.8, "clipped": 0.0}, "rmse_estimate": None, "warnings": []}


@pytest.mark.parametrize("warning", WARNINGS)
def test_every_warning_has_a_remedy_of_its_own(warning):
    assert remedy(warning) != remedy("something else")


@pytest.mark.parametrize(("file", "words"), PARTS)
def test_the_warnings_are_those_of_the_code(file, words):
    from project import ROOT

    assert words in (ROOT / file).read_text()
    assert any(words in warning for warning in WARNINGS)


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
            "inside solids; w there is filled from",
        ),
        (GOOD, {"flagged": {"hidden": 1}}, "note", "One vertex lies inside solids"),
        (GOOD, {"warnings": [WARNINGS[0]]}, "note", "uncertain by"),
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


def test_every_flag_has_its_words():
    for flag in Flag:
        found = verdict(GOOD | {"flagged": {flag.name.lower(): 3}})
        assert "3 of 9 vertices" in found["findings"][0]["what"]


@pytest.mark.parametrize("flag", list(Flag))
def test_every_flag_has_words_for_one_vertex_and_for_several(flag):
    name = flag.name.lower()
    (one,), (two,) = (flags_in_words({name: count}, 9, {}).values() for count in (1, 2))
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
    options = {"mesh": "a b.ply", "output": "w.npy", "tau": None, "denoise": False, "colors": True, "half": False}
    line = command_line("bake", BAKE, {**options, "threads": 2})
    assert line == "obscurance bake 'a b.ply' --output w.npy --no-denoise --colors"
    options = {"scene": "s.toml", "own_occlusion": True, "shadows": False}
    assert command_line("render", RENDER, options) == "obscurance render s.toml --no-shadows"
