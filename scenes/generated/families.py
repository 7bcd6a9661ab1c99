"""The families by name: each draws a mesh from a random generator, and nothing of it is the same the next time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from raytrace.mesh import Mesh

from ..shapes import Part
from .at_hand import dense_base
from .damage import DAMAGES, Damage, damaged
from .dense import Rng, log_uniform, posed, refined, sized, unit
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


class _Given:
    def __init__(self, mesh: Mesh) -> None:
        self._part, self._source = (np.array(mesh.vertices), mesh.faces), mesh.source

    def __call__(self, rng: Rng, size: int) -> Mesh:
        return posed(sized(lambda h: refined(unit(self._part), h), size), rng, self._source)


def families(given: Iterable[Mesh] = ()) -> dict[str, Family]:
    """All families by name: parts put together, and damage to the meshes at hand.

    Args: given: meshes in place of those at hand; the families are then what they are and each damage to each of them,
        called by their `source`, refined until they have as many vertices as asked for.
    """
    given = list(given)
    if not given:
        made = {name: _Drawn(make) for name, make in _MADE.items()}
        return {**made, **{name: _Drawn(_Damaged(name, *how)) for name, how in DAMAGES.items()}}
    found: dict[str, Family] = {}
    for mesh in given:
        part = np.array(mesh.vertices), mesh.faces
        found[mesh.source] = _Drawn(_Given(mesh))
        for name, how in DAMAGES.items():
            title = f"{mesh.source}, {name}"
            found[title] = _Drawn(_Damaged(title, *how, given=part))
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
