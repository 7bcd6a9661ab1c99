"""Interrupted bakes: what was traced is kept, what is continued has the same bits, what cannot be kept costs a line."""

import os
import shutil
from functools import partial

import numpy as np
import pytest
from interrupted_bakes import (
    MESH,
    METHODS,
    OPTIONS,
    Stopped,
    Tracing,
    bake,
    bake_surface,
    bake_texture,
    bits,
    folders,
    interrupted,
)
from meshes import hills

from obscurance import ao
from obscurance.ao.execute.kept import Kept
from obscurance.ao.least_squares import fit
from obscurance.ao.least_squares.conjugate_gradients import solve_within
from obscurance.ao.methods import surface_method
from obscurance.raytrace.mesh.mesh import Mesh

POSIX = pytest.mark.skipif(os.name == "nt", reason="links")
THIRD = {"samples": 128, "only": np.arange(len(MESH.vertices)) % 3 == 0}
WAYS = [
    (ao.bake, {"tolerance": 0.003}),
    (ao.bake, THIRD),
    (ao.bake, {"tolerance": 0.01, "falloff": ["binary", "exponential"]}),
    (ao.bake, {"samples": 64, "at": "faces"}),
    (ao.bake, {"samples": 64, "high": Mesh(*hills(50))}),
    (bake_surface, {"samples": 128, "only": np.arange(len(MESH.vertices)) < 400}),
    (bake_surface, {"tolerance": 0.01}),
    (bake_texture, {"samples": 64, "profile": True}),
    (bake_texture, {"tolerance": 0.01}),
]


@pytest.fixture
def output(tmp_path):
    return tmp_path / "w.npy"


@pytest.fixture(scope="module")
def whole():
    return bits(ao.bake(MESH, **OPTIONS))


@pytest.fixture(scope="module")
def whole_surface():
    return bits(bake_surface(MESH, **OPTIONS))


@pytest.mark.parametrize("method", METHODS)
def test_a_continued_bake_copies_what_was_traced(output, whole, whole_surface, method):
    messages, before, after = [], Tracing(), Tracing()
    interrupted(output, make=METHODS[method], notify=messages, make_rows=before.make)
    (folder,) = folders(output)
    assert messages == [f"{folder} keeps the rows that are done: run the command again to go on from there"]
    baked = bake(output, messages, make=METHODS[method], make_rows=after.make)
    assert bits(baked) == (whole if method == "vertex" else whole_surface)
    assert before.rows > 0.4 * len(MESH.vertices)
    assert after.rows < 0.7 * len(MESH.vertices if method == "vertex" else MESH.faces)
    assert len(messages) == 1
    assert not list(output.parent.iterdir())


def test_a_bake_interrupted_after_its_last_ray_traces_nothing_again(output, whole_surface, monkeypatch):
    def stop(*_):
        raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(surface_method, "fit_values", stop)
        interrupted(output, stop=None, make=bake_surface)
    traced = Tracing()
    assert bits(bake(output, make=bake_surface, make_rows=traced.make)) == whole_surface
    assert traced.rows == 0


def test_a_fit_is_continued_where_it_was_interrupted(output, whole_surface, monkeypatch):
    def stop(*_, **__):
        raise Stopped

    def then_stop(*arguments, **named):
        patch.setattr(fit, "solve", stop)  # the bent normals'
        return solve_within(*arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(fit, "solve_within", then_stop)
        interrupted(output, stop=None, make=bake_surface)
    solved = []
    with monkeypatch.context() as patch:
        patch.setattr(fit, "cross_validated", stop)
        patch.setattr(fit, "solve_within", lambda *a, **k: solved.append(a) or solve_within(*a, **k))
        assert bits(bake(output, make=bake_surface)) == whole_surface
    assert len(solved) == 1  # the relaxed one


@pytest.mark.parametrize("way", range(len(WAYS)))
def test_every_way_to_bake_is_continued(output, way):
    make, options = WAYS[way]
    interrupted(output, 0.5, options=options, make=make)
    assert folders(output)
    assert bits(bake(output, options=options, make=make)) == bits(make(MESH, **options))
    assert not folders(output)


def test_a_bake_of_a_few_seconds_writes_nothing(output):
    messages = []
    interrupted(output, after=10, notify=messages)
    assert (messages, list(output.parent.iterdir())) == ([], [])


CHANGES = [{"seed": 1}, {"samples": 129}, {"normals": "area"}, {"denoise": False}, {"make": bake_surface}]
CHANGES += [{"mesh": Mesh(MESH.vertices * [1, 1, 1.001], MESH.faces)}, {"make": bake_texture}]


@pytest.mark.parametrize("change", range(len(CHANGES)))
def test_rows_of_another_bake_are_not_taken_and_go_when_this_one_is_done(output, change):
    interrupted(output)
    options = OPTIONS | CHANGES[change]
    make, mesh = options.pop("make", ao.bake), options.pop("mesh", MESH)
    assert bits(bake(output, pytest.fail, make=make, mesh=mesh, options=options)) == bits(make(mesh, **options))
    assert not list(output.parent.iterdir())


@pytest.mark.parametrize("damage", ["cut", "changed", "zeros", "renamed", "empty"])
def test_a_block_that_is_not_whole_is_made_again(output, whole, damage):
    interrupted(output)
    (folder,) = folders(output)
    files = sorted(path for path in folder.iterdir() if path.stat().st_size > 100)
    content = bytearray(files[0].read_bytes())
    size = len(content)
    if damage == "cut":
        del content[size // 3 :]
    elif damage == "changed":
        content[size // 2] ^= 1
    elif damage == "zeros":
        content = bytearray(size)  # as a power failure leaves them
    elif damage == "renamed":
        content = bytearray(files[1].read_bytes())
    else:
        content = bytearray()
    files[0].write_bytes(content)
    traced = Tracing()
    assert bits(bake(output, pytest.fail, make_rows=traced.make)) == whole
    assert traced.rows
    assert not folders(output)


def test_files_of_other_names_stay_and_so_does_their_folder(output, whole):
    interrupted(output)
    (folder,) = folders(output)
    strangers = {folder / "thesis.txt", folder / f"{'0' * 32}.x", output.with_name(f"{output.name}.partial-notes")}
    for path in strangers:
        path.write_text("mine")
    assert bits(bake(output, pytest.fail)) == whole
    assert {path for path in output.parent.rglob("*") if path.is_file()} == strangers


@POSIX
@pytest.mark.parametrize("what", ["link", "file"])
def test_a_link_or_a_file_in_the_place_of_the_folder_is_left_alone(output, whole, what):
    interrupted(output)
    (folder,) = folders(output)
    elsewhere = output.with_name("elsewhere")
    if what == "link":
        folder.rename(elsewhere)
        folder.symlink_to(elsewhere)
    else:
        shutil.rmtree(folder)
        folder.write_text("mine")
    before = sorted(elsewhere.rglob("*")), folder.is_symlink() or folder.read_text()
    messages = []
    assert bits(bake(output, messages)) == whole
    reason = "not a folder of this user" if what == "link" else "File exists"
    assert messages == [f"{folder}: {reason}; going on without keeping rows"]
    assert (sorted(elsewhere.rglob("*")), folder.is_symlink() or folder.read_text()) == before


@pytest.mark.parametrize("call", ["replace", "open"])
def test_a_full_disk_does_not_stop_the_bake(output, whole, call):
    messages = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, call, partial(_fail, getattr(os, call)))
        assert bits(bake(output, messages)) == whole
    assert len(messages) == 1
    assert messages[0].endswith(": No space left on device; going on without keeping rows")
    assert not list(output.parent.iterdir())


def _fail(call, path, *arguments, **named):
    if ".partial-" in str(path) and (not arguments or arguments[0] != os.O_RDONLY):
        raise OSError(28, os.strerror(28))
    return call(path, *arguments, **named)


def test_no_more_than_half_of_the_free_disk_is_taken(output, whole, monkeypatch):
    free = 60_000

    def usage(folder):
        kept = sum(path.stat().st_size for path in folder.iterdir())
        return shutil._ntuple_diskusage(10**9, 10**9 - free, free - kept)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    messages, sizes = [], []

    def watch(done, total):
        sizes.append(sum(path.stat().st_size for folder in folders(output) for path in folder.iterdir()))

    assert bits(bake(output, messages, watch=watch)) == whole
    assert free / 4 < max(sizes) <= free / 2
    assert len(messages) == 1
    assert messages[0].endswith("kept rows would take more than half of the free disk; going on without keeping rows")


@pytest.mark.parametrize("gone", ["folder", "all"])
def test_a_folder_that_vanishes_costs_no_row(tmp_path, whole, gone):
    output = tmp_path / "out" / "w.npy"
    output.parent.mkdir()

    def vanish(done, total):
        if done > 0.5 * total:
            for folder in folders(output):
                shutil.rmtree(folder if gone == "folder" else output.parent)

    messages = []
    assert bits(bake(output, messages, watch=vanish)) == whole
    assert len(messages) <= (gone == "all")
    assert not folders(output)


def test_two_bakes_of_one_output_at_once_make_the_same_and_leave_nothing(output, whole):
    inner = []

    def watch(done, total):
        if done > 0.5 * total and not inner:
            inner.append(None)
            inner[0] = bits(bake(output, pytest.fail))

    assert bits(bake(output, pytest.fail, watch=watch)) == whole
    assert inner == [whole]
    assert not list(output.parent.iterdir())


@pytest.mark.parametrize("options", [{"samples": 64}, {"samples": 64, "profile": True}, {"tolerance": 0.01}], ids=str)
def test_what_is_kept_of_a_texture_is_at_most_three_times_its_arrays(output, options):
    sizes = [0]

    def watch(done, total):
        sizes.append(sum(path.stat().st_size for folder in folders(output) for path in folder.iterdir()))

    baked = bake(output, make=partial(bake_texture, size=120), watch=watch, options=options)
    arrays = [baked.w, baked.error, baked.bent_normals, baked.covered]
    arrays += [baked.profile.values, baked.profile_errors] if baked.profile else []
    assert 0 < max(sizes) < 3 * sum(array.nbytes for array in arrays)


@POSIX
def test_only_this_user_can_look_into_the_folder(output):
    interrupted(output)
    (folder,) = folders(output)
    assert folder.stat().st_mode & 0o777 == 0o700


def test_nothing_is_kept_without_an_output():
    with Kept(None, pytest.fail, after=0) as kept:
        ao.bake(MESH, samples=16, checkpoint=kept)
