"""Bakes in parts: each traced with a checkpoint of its own, then merged."""

import pytest
from interrupted_bakes import bits, bits_of, of_profile

from ao.execute.parts import Merge, ShardCheckpoint, read_parts

DESCRIPTION = {"mesh": "hills", "options": {"seed": 0}}


def trace_part(make, folder, number, of, **options):
    """The part, after `make` has traced it."""
    folder.mkdir(exist_ok=True)
    part = ShardCheckpoint(folder, number, of, DESCRIPTION, pytest.fail)
    part.trace(lambda: make(checkpoint=part, **options))
    return part


def merged(make, folder, **options):
    """What `make` makes of the parts in `folder`."""
    with Merge(read_parts(folder)) as parts:
        return make(checkpoint=parts, **options)


def bits_of_texture(texture):
    return bits_of(texture.values, texture.errors, texture.bent_normals, texture.covered, *of_profile(texture))


__all__ = ["DESCRIPTION", "bits", "bits_of_texture", "merged", "trace_part"]
