"""The mesh families by name, each a function of a random generator."""

from __future__ import annotations

from collections.abc import Callable

from obscurance.raytrace import Mesh

from .dense import Rng
from .inserts import blades, character, eyes, pipes, posts
from .layers import crossing_planes, nested_shells, planar_sets, scale_jumps, thin_sheets

SMALL = 17_000  # places of vertices; fewer than 16,384 points are never predicted
LARGE = 60_000


Family = Callable[[Rng, int], Mesh]
"""A random generator and a number to a mesh with vertices at that many places, seldom more than twice as many."""


FAMILIES: dict[str, Family] = {
    "posts": posts,
    "pipes": pipes,
    "eyes": eyes,
    "character": character,
    "thin sheets": thin_sheets,
    "blades": blades,
    "nested shells": nested_shells,
    "scale jumps": scale_jumps,
    "planar sets": planar_sets,
    "crossing planes": crossing_planes,
}
