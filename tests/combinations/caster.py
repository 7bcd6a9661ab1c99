"""Rays against patches, one by one in double precision, and w by them. Nothing of the baker is used."""

from dataclasses import dataclass

import numpy as np
from reference import nearest_hits

_LIFT, _CLOSE = 1e-9, 1e-6  # of the scene's size: where rays start, and what touches
PARTS = 8  # of the places and rays of a value, from whose spread its error follows
_STRATA = 8, 4  # of the places of a part


@dataclass(frozen=True)
class Medium:
    """What rays meet, and what that takes.

    Attributes:
        patches: that occlude. fronts: whether only their fronts do. ground: a point and the normal of a plane, or None.
        mu: of distances (k,). cone: sin² of half the spread. size: of the scene.
    """

    patches: list
    fronts: bool
    ground: tuple | None
    mu: object
    cone: float
    size: float


def distances(medium, origins, directions):
    """To the nearest hit (k,), or infinity."""
    squares = [part.at(np.array([0, 1, 1, 0.0]), np.array([0, 0, 1, 1.0])) for part in medium.patches]
    corners = np.concatenate([square[[[0, 1, 2], [0, 2, 3]]] for square in squares])
    nearest = nearest_hits(origins, directions, corners, medium.fronts)
    if medium.ground is not None:
        place, up = medium.ground
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (place - origins) @ up / (directions @ up)
        nearest = np.where((t > 0) & (t < nearest), t, nearest)
    return nearest


def strata(rng, count):
    """Places (count, p, 2) in the unit square: parts one after another, each even by itself."""
    across, along = _STRATA
    corner = np.stack(np.divmod(np.tile(np.arange(across * along), PARTS), along), -1)
    return (corner + rng.random((count, len(corner), 2))) / _STRATA


def values(medium, places, normals, axes, rng, rays):
    """w (k,) and its error: the mean over places (k, p, 3) with normals of their faces (k, 3) and axes (k, 3).

    A direction below the face is closed. Args: places: of parts, as of `strata`, or one. rays: of each value.
    """
    count, spread = len(places), places.shape[1] // PARTS or 1
    places = np.broadcast_to(places.reshape(count, places.shape[1] // spread, spread, 3), (count, PARTS, spread, 3))
    each = max(rays // (spread * PARTS), 1)
    u = (rng.random((count, PARTS, spread, each)) + np.arange(each)) / each * medium.cone
    phi = 2 * np.pi * rng.random((count, PARTS, spread, each))
    tangent = np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([tangent, np.cross(axes, tangent), axes], axis=1)
    local = np.stack([np.sqrt(u) * np.cos(phi), np.sqrt(u) * np.sin(phi), np.sqrt(1 - u)], axis=-1)
    directions = local.reshape(count, PARTS * spread * each, 3) @ frame
    above = (directions @ normals[:, :, None]).reshape(u.shape) >= 0
    directions = directions.reshape(local.shape)
    origins = places + _LIFT * medium.size * normals[:, None, None]
    origins = np.broadcast_to(origins[..., None, :], directions.shape)
    met = distances(medium, origins.reshape(-1, 3), directions.reshape(-1, 3)).reshape(above.shape)
    w = np.where(above, medium.mu(met), 0.0).mean(axis=(2, 3))
    return w.mean(axis=1), w.std(axis=1, ddof=1) / np.sqrt(PARTS)


def enclosed(scene, places):
    """Which of places (k, 3) are inside an object that is closed: a box of six sides."""
    inside = np.zeros(len(places), bool)
    for name in {part.name for part in scene}:
        sides = [part for part in scene if part.name == name]
        if name.startswith("box") and len(sides) == 6:
            inside |= np.all([(places - side.corner) @ side.normal < 0 for side in sides], axis=0)
    return inside


def touches(scene, part, places, size, behind=False):
    """Whether something other than `part` that reaches above its plane, or `behind` it, lies at places (k, 3) of it."""
    touched = np.zeros(len(places), bool)
    for other in scene:
        heights = (other.at(np.array([0, 1, 1, 0.0]), np.array([0, 0, 1, 1.0])) - part.corner) @ part.normal
        if other is part or (np.abs(heights) if behind else heights).max() < _CLOSE * size:
            continue
        basis = np.stack([other.u, other.v])
        st = np.clip((places - other.corner) @ np.linalg.pinv(basis), 0, 1)
        nearest = other.corner + st @ basis
        touched |= np.linalg.norm(places - nearest, axis=1) < _CLOSE * size
    return touched
