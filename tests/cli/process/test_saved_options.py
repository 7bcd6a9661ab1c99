"""`bake --options`: what an earlier bake was asked for, and what is given beside it."""

import json

import pytest
from command import obscurance, refused, succeeded
from mesh_files import obj
from meshes import hills


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    (tmp_path / "more.obj").write_bytes(obj(*hills(7)))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def options(folder, name="r.json"):
    return json.loads((folder / name).read_text())["options"]


EARLIER = (
    "--samples",
    32,
    "--falloff",
    "binary",
    "--seed",
    5,
    "--max-distance",
    "20%",
    "--no-denoise",
    "--threads",
    1,
)


def test_an_earlier_bake_is_repeated_but_for_what_is_given(folder):
    succeeded("bake", "hills.obj", "-o", "w.glb", "--report", "r.json", *EARLIER)
    again = ("--options", "r.json", "--report", "s.json")
    succeeded("bake", "-o", "again.glb", *again)
    assert (folder / "again.glb").read_bytes() == (folder / "w.glb").read_bytes()
    succeeded("bake", "more.obj", "-o", "more.ply", *again, "--seed", 6, "--denoise")
    changed = {"mesh": "more.obj", "output": "more.ply", "seed": 6, "denoise": True, "occlusion": "none"}
    old, new = options(folder), options(folder, "s.json")
    assert new == old | changed | {"threads": new["threads"]}


def test_the_options_of_a_batch_are_those_of_its_manifest(folder):
    succeeded("bake", "*.obj", "--output-dir", "out", "--format", "npy", *EARLIER)
    succeeded("bake", "more.obj", "-o", "more.npy", "--options", "out/manifest.json")
    assert (folder / "more.npy").read_bytes() == (folder / "out" / "more.npy").read_bytes()


WRONG = {
    "no JSON": ("o hills", "r.json: content: expected the report of a bake, JSON, got something else"),
    "no report": ("[]", "r.json: options: expected the report of a bake, or the manifest of a batch, got something"),
    "a later schema": ('{"schema_version": 9, "options": {}}', "expected a report of schema version 1, got 9"),
    "another report": ('{"settings": {}}', "got the report of a rendering"),
    "an option that is gone": ('{"options": {"smaples": 3}}', "r.json: options.smaples", "did you mean samples?"),
    "an option of no report": ('{"options": {"output_dir": "x"}}', "expected options of this version"),
    "a number that is none": (
        '{"options": {"samples": "many"}}',
        "r.json: options.samples: expected a whole number, got many",
    ),
    "a switch that is none": (
        '{"options": {"denoise": "maybe"}}',
        "r.json: options.denoise: expected true or false",
    ),
    "a choice that is none": ('{"options": {"falloff": "exp"}}', "did you mean exponential?"),
    "a table": ('{"options": {"seed": {"a": 1}}}', "r.json: options.seed: expected a whole number"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_taken_over_is_refused_in_one_line(folder, name):
    text, *words = WRONG[name]
    (folder / "r.json").write_text(text)
    refused(obscurance("bake", "hills.obj", "-o", "w.npy", "--options", "r.json"), *words)
    assert not (folder / "w.npy").exists()


def test_a_missing_report_and_a_missing_output_are_reported(folder):
    (folder / "report.json").write_text('{"options": {"output": "w.npy"}}')
    refused(obscurance("bake", "hills.obj", "-o", "w.npy", "--options", "reports.json"), "did you mean report.json?")
    refused(obscurance("bake", "hills.obj", "--options", "report.json"), "bake --output: expected a file")


@pytest.mark.parametrize(("name", "value"), [("occluder", ["a\0b.obj"]), ("up", "a\0"), ("report", "\0")])
def test_null_characters_are_refused_in_one_line(folder, name, value):
    (folder / "r.json").write_text(json.dumps({"options": {name: value}}))
    refused(obscurance("bake", "hills.obj", "-o", "w.npy", "--options", "r.json"), f"r.json: options.{name}: expected")
