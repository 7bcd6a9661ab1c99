"""Bakes in parts: whatever their number and order, merged they are the bake of one process, bit by bit."""

import shutil
from functools import partial

import numpy as np
import pytest
from meshes import crumpled, hills, two_boxes
from parts_of_bakes import DESCRIPTION, bits, bits_of_texture, merged, trace_part
from uv_meshes import grid_charts

import ao
import ao.execute.parts
import ao.execute.tracer
from ao.execute.journal import IDENTITY, MAGIC
from ao.execute.parts import DESCRIPTION as DESCRIPTION_BLOCK
from ao.execute.parts import WHOLE, ShardCheckpoint, assign_shards, read_parts
from ao.execute.work import bit_environment
from raytrace import InputError, Mesh, OptionError, OutputError

HILLS = Mesh(*hills(40))
LIMITED = ao.Exponential(tau=2.0, max_distance="30%")
BAKES = {
    "binary": partial(ao.bake, HILLS, "binary", samples=64),
    "exponential": partial(ao.bake, HILLS, samples=64),
    "limited": partial(ao.bake, HILLS, LIMITED, samples=64),
    "falloffs": partial(ao.bake, HILLS, ["binary", LIMITED], samples=64, profile=True),
    "raw": partial(ao.bake, HILLS, samples=16, denoise=False),
    "folded": partial(ao.bake, Mesh(*crumpled(hills(30), 0.5, 1)), samples=64),
    "partly inside": partial(ao.bake, Mesh(*two_boxes()), samples=64),
    "surface": partial(ao.bake, HILLS, samples=64, method="surface"),
}


@pytest.mark.parametrize("name", BAKES)
def test_merged_parts_are_the_whole_bake(tmp_path, name):
    make = BAKES[name]
    whole = bits(make())
    for of in (1, 2, 7):
        folder = tmp_path / str(of)
        order = np.random.default_rng(of).permutation(of) + 1
        rays = [trace_part(make, folder, int(number), of).rays for number in order]
        assert bits(merged(make, folder)) == whole
        if len(make.args[0].vertices) > 1000:
            assert max(rays) < 1.3 * sum(rays) / of


class Poisoned:
    """NumPy, but that new memory holds signalling NaNs."""

    def __getattr__(self, name):
        return getattr(np, name)

    def empty(self, *shape):
        return np.full(*shape, 0x7FF0000000000001, np.uint64).view(np.float64)


def test_rows_that_other_parts_trace_bring_no_warnings(tmp_path, monkeypatch):
    monkeypatch.setattr(ao.execute.tracer, "np", Poisoned())
    mesh = Mesh(*hills(12))
    trace_part(partial(ao.bake_texture, mesh, grid_charts(len(mesh.faces)), 64, samples=64), tmp_path / "parts", 1, 2)


@pytest.mark.parametrize("of", [1, 2, 7])
def test_merged_parts_of_a_texture_are_the_whole(tmp_path, of):
    mesh = Mesh(*hills(12))
    make = partial(ao.bake_texture, mesh, grid_charts(len(mesh.faces)), 48, samples=64, profile=of == 2)
    for number in range(of, 0, -1):
        trace_part(make, tmp_path / "parts", number, of)
    assert bits_of_texture(merged(make, tmp_path / "parts")) == bits_of_texture(make())


def test_every_row_has_one_owner_and_neighbours_mostly_the_same():
    for count, of in ((0, 3), (1, 3), (100_000, 16), (1000, 7)):
        own = assign_shards(count, of)
        assert own.shape == (count,)
        assert ((own >= 1) & (own <= of)).all()
    own = assign_shards(100_000, 16)
    assert np.ptp(np.bincount(own)[1:]) < 500
    assert np.count_nonzero(np.diff(own)) < 300


MAKE = BAKES["exponential"]


@pytest.fixture
def parts(tmp_path):
    for number in (1, 2, 3):
        trace_part(MAKE, tmp_path, number, 3)
    return tmp_path


def test_parts_trace_no_row_twice(parts):
    blocks = [block for part in read_parts(parts) for block in part.blocks if block not in (DESCRIPTION_BLOCK, WHOLE)]
    assert sum(last - first for _, first, last in blocks) == 40**2 + 128  # and some again, to calibrate errors


def said(folder, make=MAKE):
    with pytest.raises(InputError) as refusal:
        merged(make, folder)
    text = str(refusal.value)
    assert "\n" not in text
    return text.replace(str(folder), "FOLDER")


def test_a_missing_part_is_named(parts):
    (parts / "part-2-of-3.part").unlink()
    assert said(parts) == "FOLDER: parts: expected all of 1 to 3, got 2 of them; missing: 2"


def test_a_part_of_another_number_is_named(parts):
    trace_part(MAKE, parts, 2, 7)
    assert said(parts) == "FOLDER/part-2-of-7.part: number of parts: expected 3, as in the other parts, got 7"


@pytest.mark.parametrize("change", [{"seed": 1}, {"normals": "area"}, {"falloff": "binary"}, {"samples": 65}])
def test_a_part_of_another_bake_is_named(parts, change):
    (parts / "part-2-of-3.part").unlink()
    trace_part(partial(ao.bake, HILLS, **{"samples": 64} | change), parts, 2, 3)
    assert said(parts).startswith("FOLDER/part-2-of-3.part: header: expected what the other parts have")


def test_a_part_of_another_mesh_is_named(parts):
    (parts / "part-3-of-3.part").unlink()
    trace_part(partial(ao.bake, Mesh(*hills(41)), samples=64), parts, 3, 3)
    assert said(parts).startswith("FOLDER/part-3-of-3.part: mesh: expected ")


def test_a_part_from_another_processor_is_named(parts, monkeypatch):
    (parts / "part-1-of-3.part").unlink()
    monkeypatch.setitem(bit_environment(), "processor", "a z80")
    trace_part(MAKE, parts, 1, 3)
    assert said(parts).startswith("FOLDER/part-1-of-3.part: processor: expected ")
    assert said(parts).endswith("got a z80")


def test_parts_of_another_mesh_or_processor_than_the_merging_ones_are_refused(parts, monkeypatch):
    assert said(parts, partial(ao.bake, Mesh(*hills(41)), samples=64)).startswith("FOLDER: mesh: expected ")
    assert said(parts, partial(ao.bake, HILLS, samples=64, seed=1)).startswith("FOLDER: header: expected ")
    monkeypatch.setitem(bit_environment(), "Embree", "3.0")
    assert said(parts).startswith("FOLDER: Embree: expected ")


def test_an_interrupted_part_is_named_and_continued(tmp_path):
    def stop(done, total, stage):
        if done > 0.7 * total:
            raise KeyboardInterrupt

    trace_part(MAKE, tmp_path, 2, 2)
    messages = []
    with pytest.raises(KeyboardInterrupt), ShardCheckpoint(tmp_path, 1, 2, DESCRIPTION, messages.append) as part:
        MAKE(checkpoint=part, progress=stop)
    assert messages == [f"{part.path} keeps what is done; the same command continues from it"]
    assert said(tmp_path).startswith("FOLDER/part-1-of-2.part: content: expected a finished part")
    trace_part(MAKE, tmp_path, 1, 2)
    assert bits(merged(MAKE, tmp_path)) == bits(MAKE())


def test_a_torn_part_is_not_believed(parts):
    path = parts / "part-1-of-3.part"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert said(parts).startswith("FOLDER/part-1-of-3.part: content: expected a finished part")


def test_a_folder_without_parts_is_refused(tmp_path):
    assert "expected files that end in .part" in said(tmp_path)
    assert "expected a folder of parts" in said(tmp_path / "none")
    (tmp_path / "a.part").write_text("mine")
    assert said(tmp_path) == "FOLDER/a.part: content: expected a finished part, got another file"


def test_a_full_disk_ends_the_part_and_keeps_what_is_done(tmp_path, fail_call):
    fail_call("fsync")
    with (
        pytest.raises(OutputError, match=r"part-1-of-1\.part: No space left on device; the same command continues"),
        ShardCheckpoint(tmp_path, 1, 1, DESCRIPTION, pytest.fail) as part,
    ):
        MAKE(checkpoint=part)


def test_a_tolerance_has_no_parts(tmp_path):
    with (
        pytest.raises(OptionError, match="part and tolerance exclude each other"),
        ShardCheckpoint(tmp_path, 1, 2, DESCRIPTION, pytest.fail) as part,
    ):
        ao.bake(HILLS, tolerance=0.1, checkpoint=part)
    assert not list(tmp_path.iterdir())


def test_a_part_whose_folder_vanishes_is_reported(tmp_path):
    folder = tmp_path / "parts"
    folder.mkdir()

    def vanish(done, total, stage):
        if done < total and part.path.exists():
            shutil.rmtree(folder)

    part = ShardCheckpoint(folder, 1, 2, DESCRIPTION, pytest.fail)
    part.after = part.every = 0
    with pytest.raises(OutputError, match=r"part-1-of-2\.part: No such file or directory"), part:
        ao.bake(Mesh(*hills(100)), samples=256, threads=1, checkpoint=part, progress=vanish)


@pytest.mark.parametrize("more", [0, 10])
def test_a_part_killed_before_it_is_described_is_continued(tmp_path, more):
    whole = bits(MAKE())
    for number in (1, 2):
        trace_part(MAKE, tmp_path, number, 2)
    path = tmp_path / "part-1-of-2.part"
    path.write_bytes(path.read_bytes()[: len(MAGIC) + IDENTITY + more])
    trace_part(MAKE, tmp_path, 1, 2)
    assert bits(merged(MAKE, tmp_path)) == whole
