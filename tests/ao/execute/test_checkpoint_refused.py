"""Journals of other bakes and files of something else are refused and never overwritten."""

import os

import pytest
from interrupted_bakes import MESH, METHODS, OPTIONS, bake, bake_surface, interrupted

import ao
import ao.execute.tracer
import ao.least_squares.fit
import ao.least_squares.patch
import ao.methods.surface_method
from ao.execute.checkpoint import Checkpoint
from ao.execute.journal import IDENTITY, MAGIC, Journal
from raytrace.errors import InputError, OutputError
from raytrace.mesh.mesh import Mesh

CHANGES = [{"seed": 1}, {"samples": 1023}, {"normals": "area"}, {"denoise": False}]
POSIX = pytest.mark.skipif(os.name == "nt", reason="POSIX locks, limits and signals")


@pytest.mark.parametrize(
    ("method", "change"),
    [("vertex", change) for change in CHANGES] + [("surface", change) for change in CHANGES[:3]],
    ids=str,
)
def test_the_journal_of_another_bake_is_refused(path, method, change):
    make = METHODS[method]
    interrupted(path, make=make)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"w\.npy\.partial: header: expected the journal of this very bake"):
        bake(path, resume=True, options=OPTIONS | change, make=make)
    assert path.read_bytes() == before


def test_a_bake_by_the_other_method_is_another_bake(path):
    interrupted(path)
    with pytest.raises(InputError, match="expected the journal of this very bake"):
        bake(path, resume=True, make=bake_surface)


def test_another_mesh_is_another_bake(path):
    interrupted(path)
    with pytest.raises(InputError), Checkpoint(path, resume=True) as checkpoint:
        ao.bake(Mesh(MESH.vertices * [1, 1, 1.001], MESH.faces), checkpoint=checkpoint, **OPTIONS)


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize("content", [b"a chapter of my thesis", bytes(4096) + b"a disk", MAGIC[:9] + bytes(40) + b"x"])
def test_a_file_of_something_else_is_never_overwritten(path, resume, content):
    path.write_bytes(content)
    with pytest.raises(OutputError, match="expected the journal of a bake"):
        bake(path, resume=resume)
    assert path.read_bytes() == content


@POSIX
@pytest.mark.parametrize("resume", [False, True])
def test_a_second_bake_to_the_same_target_is_refused(path, resume):
    holder = Journal(path, create=True)
    holder.start()
    with pytest.raises(OutputError, match="another bake to the same target is at work"):
        bake(path, resume=resume)
    holder.close()
    assert path.read_bytes() == MAGIC + bytes(IDENTITY)
