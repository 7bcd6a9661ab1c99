"""Parts and journals that nobody has traced: named pipes, and right checksums around anything else, have one line."""

import json
import os

import numpy as np
import pytest
from command import obscurance, refused
from mesh_files import ply
from meshes import hills

from ao.execute.journal import MAGIC, Journal, record
from ao.execute.parts import DESCRIPTION, WHOLE


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "hills.ply").write_bytes(ply(*hills(8)))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def forge(path, change):
    """Write a part anew. Args: change: makes of a block and its content another content."""
    journal = Journal(path, create=False)
    blocks = [(block, journal.content(block)) for block in journal.blocks]
    journal.close()
    made = b"".join(record(block, change(block, content)) for block, content in blocks)
    path.write_bytes(MAGIC + journal.identity + made)


def described(change):
    def changed(block, content):
        return change(json.loads(content)) if block == DESCRIPTION else content

    return changed


def with_options(**options):
    return described(lambda found: json.dumps(found | {"options": found["options"] | options}).encode())


def with_rows(value, column=0, dtype=np.float64):
    def changed(block, content):
        rows = np.frombuffer(content, dtype).copy()
        rows[column :: 6 if dtype == np.float64 else 1] = value
        return rows.tobytes()

    return lambda block, content: content if block in (DESCRIPTION, WHOLE) else changed(block, content)


FORGED = {
    "w that is no number": (with_rows(np.nan), "part-1-of-1.part: rows: expected all of its share of ", "impossible"),
    "w that is infinite": (with_rows(np.inf), "part-1-of-1.part: rows: "),
    "w above 1": (with_rows(1.5), "part-1-of-1.part: rows: "),
    "w below 0": (with_rows(-0.5), "part-1-of-1.part: rows: "),
    "a direction that is no number": (with_rows(np.nan, 3), "part-1-of-1.part: rows: "),
    "JSON of many levels": (
        described(lambda _: b"[" * 100_000 + b"]" * 100_000),
        "description: expected that of a part",
    ),
    "no JSON": (described(lambda _: b"\xff"), "description: expected that of a part"),
    "a list": (described(lambda _: b"[]"), "description: expected that of a part"),
    "no machine": (described(lambda found: json.dumps(found | {"machine": 1}).encode()), "description: "),
    "a part's number as text": (described(lambda found: json.dumps(found | {"part": "1"}).encode()), "description: "),
    "very many parts": (described(lambda found: json.dumps(found | {"of": 10**15}).encode()), "missing: 2, 3, 4, "),
    "a mesh that is a number": (described(lambda found: json.dumps(found | {"mesh": 3}).encode()), "description: "),
    "occluders as a text": (described(lambda f: json.dumps(f | {"occluder": "a"}).encode()), "options.occluder: "),
    "samples as a text": (
        with_options(samples="many"),
        "part-1-of-1.part: options.samples: expected a whole number, got many",
    ),
    "too many samples": (with_options(samples=10**30), "samples: expected "),
    "a seed as a table": (with_options(seed={}), "part-1-of-1.part: options.seed: "),
    "names as a text": (with_options(receive="a"), "part-1-of-1.part: options.receive: expected a list of texts"),
    "a rate that is no number": (with_options(tau=float("nan")), "description: "),
    "a falloff as a list": (with_options(falloff=[3]), "part-1-of-1.part: options.falloff: "),
    "a falloff as a number": (with_options(falloff=3), "part-1-of-1.part: options.falloff: expected a text, got 3"),
    "another rate": (with_options(tau=3.0), "parts: header: expected that of this very bake"),
    "what is no option of parts": (with_options(run="x", content="x", output=3), None),
}


@pytest.mark.parametrize("name", FORGED)
def test_forged_parts_are_refused_in_a_line(folder, name):
    change, *words = FORGED[name]
    assert obscurance("bake", "hills.ply", "--part", "1/1", "-o", "parts", "--samples", 16).returncode == 0
    forge(folder / "parts" / "part-1-of-1.part", change)
    merge = "merge", "parts", "-o", "w.npz"
    if words == [None]:
        assert obscurance(*merge).returncode == 0
        return
    refused(obscurance(*merge), *words)
    assert not (folder / "w.npz").exists()


@pytest.mark.parametrize("value", [np.nan, 1e300, -5.0])
def test_forged_parts_of_the_surface_method_are_refused_in_a_line(folder, value):
    bake = "bake", "hills.ply", "--method", "surface", "--samples", 16
    assert obscurance(*bake, "--part", "1/1", "-o", "parts").returncode == 0
    forge(folder / "parts" / "part-1-of-1.part", with_rows(value))
    refused(obscurance("merge", "parts", "-o", "w.npz"), "part-1-of-1.part: rows: expected all of its share of ")


ENTRY = {"input": "a", "output": "b", "status": "done", "seconds": 1.0, "message": "", "warnings": []}
ENTRY |= {"sha256": "", "output_sha256": ""}
MANIFEST = {"manifest_version": 1, "options": {}, "versions": {}, "waiting": 0}
MANIFEST |= {"part": {"number": 1, "of": 1, "inputs": ["a"]}, "inputs": [ENTRY]}
MANIFESTS = {
    "of many levels": '{"a": ' * 100_000 + "1" + "}" * 100_000,
    "with inputs as lists": json.dumps(MANIFEST | {"inputs": [ENTRY | {"input": ["a"]}]}),
    "with names as lists": json.dumps(MANIFEST | {"part": {"number": 1, "of": 1, "inputs": [["a"]]}}),
    "with seconds that are no number": json.dumps(MANIFEST | {"inputs": [ENTRY | {"seconds": float("nan")}]}),
    "with options that are no number": json.dumps(MANIFEST | {"options": {"tau": float("inf")}}),
    "of part 0": json.dumps(MANIFEST | {"part": {"number": 0, "of": 1, "inputs": ["a"]}}),
}


@pytest.mark.parametrize("name", MANIFESTS)
def test_forged_manifests_of_parts_are_refused_in_a_line(folder, name):
    (folder / "manifest-1-of-1.json").write_text(json.dumps(MANIFEST))
    assert obscurance("merge", ".").returncode == 0
    (folder / "manifest-1-of-1.json").write_text(MANIFESTS[name])
    refused(obscurance("merge", "."), "manifest-1-of-1.json: manifest_version: expected the manifest of a part")


def test_a_manifest_of_very_many_parts_is_refused_in_a_line(folder):
    manifest = MANIFEST | {"part": {"number": 1, "of": 10**15, "inputs": ["a"]}}
    (folder / "manifest-1-of-1.json").write_text(json.dumps(manifest))
    refused(obscurance("merge", "."), "missing: 2, 3, 4, ")


PIPED = {
    "a journal": ("bake hills.ply -o w.npy", "w.npy.partial", "expected the journal of a bake or no such file"),
    "a journal to resume": ("bake hills.ply -o w.npy --resume", "w.npy.partial", "expected the journal of a bake"),
    "a part to continue": ("bake hills.ply --part 1/1 -o parts", "parts/part-1-of-1.part", "expected the journal"),
    "a part": ("merge parts -o w.npy", "parts/part-1-of-1.part", "expected a finished part"),
    "a manifest": ("merge parts", "parts/manifest-1-of-1.json", "expected the manifest of a part"),
    "a bake": ("view w.npy --mesh hills.ply", "w.npy", "expected a file of w"),
    "a bake of several arrays": ("view w.npz --mesh hills.ply", "w.npz", "expected a file of w"),
    "a profile": ("falloff w.npz --half-distance 3 -o x.npz", "w.npz", "expected a file of w"),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes")
@pytest.mark.parametrize("name", PIPED)
def test_named_pipes_are_refused_in_a_line(folder, name):
    line, pipe, words = PIPED[name]
    (folder / "parts").mkdir()
    os.mkfifo(folder / pipe)
    refused(obscurance(*line.split()), pipe, words)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes")
@pytest.mark.parametrize("pipe", ["pipe.obj", "pipe.gltf"])
def test_a_named_pipe_in_a_batch_has_its_line(folder, pipe):
    os.mkfifo(folder / pipe)
    result = obscurance("bake", pipe, "hills.ply", "--output-dir", "out", "--samples", 16)
    assert result.returncode == 1
    assert f"{pipe}: file: expected a mesh file, got something that is not a regular file\n" in result.stderr
    assert (folder / "out" / "hills.ply").exists()
