"""The mesh families by name, each a function of a random generator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from meshes import raw_mesh

from obscurance.raytrace import Mesh, MeshError
from obscurance.scenes.geometry.polyhedra import RawMesh

from .bases import dense_base
from .damage import DAMAGES, Damage, damaged
from .dense import Rng, extent, placed, refined, sized, unit, used
from .inserts import blades, character, eyes, pipes, posts, slab_with_posts
from .layers import crossing_planes, nested_shells, planar_sets, scale_jumps, terraces, thin_sheets

SMALL = 17_000  # places of vertices; fewer than 16,384 points are never predicted
LARGE = 60_000


Family = Callable[[Rng, int], Mesh]
"""A random generator and a number to a mesh with vertices at that many places, seldom more than twice as many."""


def _damaged(name: str, damage: Damage, surplus: float, given: RawMesh | None = None) -> Family:
    return lambda rng, size: placed(damaged(damage, dense_base(rng, given), size, surplus, rng), rng, name)


def _given(name: str, part: RawMesh) -> Family:
    return lambda rng, size: placed(sized(lambda h: refined(part, h), size), rng, name)


def _unit(mesh: Mesh) -> RawMesh:
    part = used(raw_mesh(mesh))
    if not len(part[1]) or extent(part) == 0:
        raise MeshError(mesh.source, "faces", "some that are not points", "none")
    return unit(part)


def families(given: Iterable[Mesh] = ()) -> dict[str, Family]:
    """All families by name: parts put together, and damage to the meshes at hand.

    Args: given: meshes in place of those at hand; the families are then what they are and each damage to each of them,
        called by their file's name, refined until they have as many vertices as asked for.

    Raises:
        MeshError: a given mesh has no extent.
    """
    given = list(given)
    if not given:
        return _MADE | {name: _damaged(name, *how) for name, how in DAMAGES.items()}
    found: dict[str, Family] = {}
    short = [Path(mesh.source).name for mesh in given]
    called = short if len(set(short)) == len(short) else [mesh.source for mesh in given]
    for mesh, title in zip(given, called, strict=True):
        part = _unit(mesh)
        found[title] = _given(title, part)
        for name, how in DAMAGES.items():
            found[f"{title}, {name}"] = _damaged(f"{title}, {name}", *how, given=part)
    return found


_MADE: dict[str, Family] = {
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
