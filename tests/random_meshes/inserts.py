"""Objects set into dense surfaces, exactly touching, intersecting or slightly above: posts, pipes, eyes, blades."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh, join

from .dense import Make, Rng, displacement, field, log_uniform, placed, sized
from .pieces import ball, box, capsule, cells, cylinder, knot, moved, random_turn, ring, sheet, solid

Height = Callable[[Float64s], Float64s]


def _ground(rng: Rng) -> tuple[Make, Height]:
    """A dense ground of size 1 × 1, flat or wavy, and its height z at points (n, 2)."""
    amplitude = 0.0 if rng.random() < 0.4 else log_uniform(rng, 0.005, 0.08)
    waves = field(rng, 0.4, 3.0)

    def height(xy: Float64s) -> Float64s:
        return amplitude * waves(np.column_stack([xy, np.zeros(len(xy))])) if amplitude else np.zeros(len(xy))

    def surface(s: Float64s, t: Float64s) -> Float64s:
        xy = np.stack([s.ravel(), t.ravel()], -1) - 0.5
        return np.column_stack([xy, height(xy)]).reshape(*s.shape, 3)

    return lambda h: sheet(surface, cells(1.0, h), cells(1.0, h)), height


def _clearance(rng: Rng, reach: float) -> float:
    """How far above the ground a thing begins: exactly on it, a hair above, or sunk by up to `reach`."""
    kind = rng.integers(3)
    return (0.0, log_uniform(rng, 1e-6, 1e-2), -reach * rng.uniform(0.02, 1.0))[kind]


def posts(rng: Rng, size: int) -> Mesh:
    """Posts of any footprint, 3 to 40, on flat or wavy ground, upright or leaning."""
    ground, height = _ground(rng)
    makes = [ground, *(_post(rng, height) for _ in range(int(log_uniform(rng, 3, 41))))]
    return placed(sized(lambda h: join([make(h) for make in makes]), size), rng, "posts")


def _post(rng: Rng, height: Height) -> Make:
    xy = rng.uniform(-0.48, 0.48, 2)
    a, b, c = log_uniform(rng, 0.01, 0.08), log_uniform(rng, 0.01, 0.08), log_uniform(rng, 0.02, 0.5)
    turn, hard, is_round = random_turn(rng, upright=True), bool(rng.random() < 0.5), rng.random() < 0.4
    foot = np.array([*xy, float(height(xy[None])[0]) + _clearance(rng, 0.3 * c) + c / 2])
    lean = np.diag([1.0, 1.0, 1.0])
    if rng.random() < 0.25:
        lean[:2, 2] = rng.uniform(-0.4, 0.4, 2)

    def make(h: float) -> RawMesh:
        vertices, faces = cylinder(a / 2, c, h, hard) if is_round else box((a, b, c), h, hard)
        return moved((vertices @ lean.T, faces), foot, turn)

    return make


def pipes(rng: Rng, size: int) -> Mesh:
    """Pipes, rings and winding tubes lying on the ground, half sunk into it, or a hair above."""
    ground, height = _ground(rng)
    makes = [ground, *(_pipe(rng, height) for _ in range(int(rng.integers(2, 12))))]
    return placed(sized(lambda h: join([make(h) for make in makes]), size), rng, "pipes")


def _pipe(rng: Rng, height: Height) -> Make:
    radius, length = log_uniform(rng, 0.008, 0.08), rng.uniform(0.15, 0.8)
    xy, kind, turn = rng.uniform(-0.35, 0.35, 2), rng.integers(4), random_turn(rng, upright=True)
    shift = np.array([*xy, float(height(xy[None])[0]) + radius + _clearance(rng, 1.8 * radius)])
    winding = knot(rng, radius / length)

    def make(h: float) -> RawMesh:
        if kind == 0:
            return moved(ring(max(length / 2, 1.2 * radius), radius, h), shift, turn)
        if kind == 1:
            return moved(winding(h / length), shift, turn, length)
        vertices, faces = capsule(radius, length, h) if kind == 2 else cylinder(radius, length, h, hard=False)
        return moved((vertices[:, [2, 0, 1]], faces), shift, turn)

    return make


def eyes(rng: Rng, size: int) -> Mesh:
    """A bumpy head with balls set into it, in sockets of their own size or just through the skin, some under lids."""
    bumps = displacement(rng, rng.uniform(0.2, 1.0))
    looks = rng.normal(size=(int(rng.integers(2, 14)), 3))
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    radii = np.exp(rng.uniform(np.log(0.02), np.log(0.25), len(looks)))
    depth = radii * rng.uniform(-0.9, 0.9, len(looks))
    sockets, lids = rng.random(len(looks)) < 0.5, rng.random(len(looks)) < 0.3
    gaps = [0.0 if rng.random() < 0.4 else log_uniform(rng, 1e-5, 2e-2) for _ in looks]

    def make(h: float) -> RawMesh:
        skin, faces = ball(1.0, h)
        skin = skin + bumps(skin)
        parts: list[RawMesh] = []
        for look, radius, deep, socket, lid, gap in zip(looks, radii, depth, sockets, lids, gaps, strict=True):
            point = look + bumps(look[None])[0]
            centre = point - deep * look
            if socket:  # the skin is pressed onto the ball, or a gap above it
                off = skin - centre
                far = np.linalg.norm(off, axis=1, keepdims=True)
                skin = np.where(
                    far < radius * (1 + gap), centre + off / np.maximum(far, 1e-12) * radius * (1 + gap), skin
                )
            parts.append(moved(ball(radius, h), centre))
            if lid:
                cover, triangles = ball(radius * (1.001 + gap), h)
                parts.append((cover + centre, triangles[(cover[triangles][:, :, 2] > 0.2 * radius).all(axis=1)]))
        return join([(skin, faces), *parts])

    return placed(sized(make, size), rng, "eyes")


def blades(rng: Rng, size: int) -> Mesh:
    """Blades like hair or grass, thin and bent, on or through flat or wavy ground; a third of the vertices or more."""
    ground, height = _ground(rng)
    share, steps = rng.uniform(0.3, 0.8), int(rng.integers(3, 12))
    count = max(int(share * size / (2 * steps + 2)), 20)
    xy = rng.uniform(-0.5, 0.5, (count, 2)) * rng.choice([0.25, 1.0])
    width, long, bend = log_uniform(rng, 1e-3, 2e-2), log_uniform(rng, 0.02, 0.3), rng.uniform(0.0, 1.5)
    sunk = rng.choice([0.0, -0.01, 1e-4])
    angle, lean = rng.uniform(0, 2 * np.pi, count), rng.normal(size=(count, 1, 2)) * bend
    t = np.linspace(0, 1, steps + 1)[None, :, None]
    spine = np.concatenate(
        [xy[:, None] + long * lean * t**2, height(xy)[:, None, None] + sunk + long * t + 0 * lean[..., :1]], -1
    )
    side = (width / 2) * np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)[:, None] * (1 - 0.9 * t)
    vertices = np.stack([spine - side, spine + side], axis=2).reshape(-1, 3)
    first = (np.arange(count)[:, None] * (steps + 1) + np.arange(steps)).reshape(-1, 1) * 2
    strips = vertices, np.concatenate([first + np.array([0, 1, 3]), first + np.array([0, 3, 2])])
    return placed(sized(lambda h: join([ground(h), strips]), size), rng, "blades")


def character(rng: Rng, size: int) -> Mesh:
    """A figure of 6 to 25 closed parts, ellipsoids, capsules, rings and boxes, each through the one before."""
    makes: list[Make] = []
    centres = [np.zeros(3)]
    for _ in range(int(rng.integers(6, 26))):
        length = log_uniform(rng, 0.08, 0.6)
        makes.append(solid(rng, length))
        if len(makes) > 1:
            parent = centres[rng.integers(len(centres))]
            way = rng.normal(size=3)
            centres.append(parent + way / np.linalg.norm(way) * length * rng.uniform(0.2, 0.6))
    even = rng.random() < 0.5
    relative = np.ones(len(makes)) if even else np.exp(rng.uniform(-1, 1, len(makes)))

    def make(h: float) -> RawMesh:
        return join([moved(make(h * f), c) for make, c, f in zip(makes, centres, relative, strict=True)])

    return placed(sized(make, size), rng, "character")
