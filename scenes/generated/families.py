"""The families by name: each draws a mesh from a random generator, and nothing of it is the same the next time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from raytrace.mesh import Mesh

from ..shapes import Part
from .at_hand import dense_base
from .damage import DAMAGES, Damage, damaged
from .dense import Rng, log_uniform, posed
from .inserts import blades, character, eyes, pipes, posts, slab_with_posts
from .layers import crossing_planes, nested_shells, planar_sets, scale_jumps, terraces, thin_sheets

SMALL = 17_000  # places of vertices; fewer than 16,384 points are never predicted
LARGE = 60_000


class Family(Protocol):
    """A way to draw meshes."""

    def __call__(self, rng: Rng, size: int | None = None) -> Mesh:
        """A mesh with vertices at about `size` places, seldom fewer, up to twice as many; 17,000 to 60,000 for None."""
        ...


class _Drawn:
    def __init__(self, make: Callable[[Rng, int], Mesh]) -> None:
        self._make = make

    def __call__(self, rng: Rng, size: int | None = None) -> Mesh:
        return self._make(rng, int(log_uniform(rng, SMALL, LARGE / 1.3)) if size is None else size)


class _Damaged:
    def __init__(self, name: str, damage: Damage, surplus: float, given: Part | None = None) -> None:
        self._name, self._damage, self._surplus, self._given = name, damage, surplus, given

    def __call__(self, rng: Rng, size: int) -> Mesh:
        base = dense_base(rng, self._given)
        return posed(damaged(self._damage, base, size, self._surplus, rng), rng, self._name)


def families(given: Iterable[Mesh] = ()) -> dict[str, Family]:
    """All families by name: those of parts put together, those of damage to meshes at hand.

    Args: given: meshes to be damaged as well, each in each way; their families have their `source` in the name.
    """
    found: dict[str, Family] = {name: _Drawn(make) for name, make in _MADE.items()}
    for name, (damage, surplus) in DAMAGES.items():
        found[name] = _Drawn(_Damaged(name, damage, surplus))
    for mesh in given:
        part = np.array(mesh.vertices), mesh.faces
        for name, (damage, surplus) in DAMAGES.items():
            title = f"{mesh.source}, {name}"
            found[title] = _Drawn(_Damaged(title, damage, surplus, part))
    return found


_MADE: dict[str, Callable[[Rng, int], Mesh]] = {
    "slab with posts": slab_with_posts,
    "posts": posts,
    "pipes": pipes,
    "eyes": eyes,
    "character": character,
    "thin sheets": thin_sheets,
    "blades": blades,
    "nested shells": nested_shells,
    "terraces": terraces,
    "scale jumps": scale_jumps,
    "planar sets": planar_sets,
    "crossing planes": crossing_planes,
}
