"""Random dense meshes of some families: each a function of a random generator that gives a part at any fineness."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable

import numpy as np
from meshes import raw_mesh
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry import primitives
from obscurance.scenes.geometry.polyhedra import RawMesh, join

Rng = np.random.Generator
Field = Callable[[Float64s], Float64s]
Make = Callable[[float], RawMesh]
SURPLUS = 1.25  # vertices more than asked for that `sized` is content with
_SAME = 1e-7  # of a part's extent: vertices nearer than this are one


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """A number between `low` and `high`, every power of ten as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def field(rng: Rng, low: float, high: float) -> Field:
    """A smooth random function of points (n, 3), mean 0 and variance 1: 24 waves of `low` to `high` per unit length."""
    waves = rng.normal(size=(24, 3))
    waves *= (
        2 * np.pi * np.exp(rng.uniform(np.log(low), np.log(high), (24, 1))) / np.linalg.norm(waves, axis=1)[:, None]
    )
    phases = rng.uniform(0, 2 * np.pi, 24)
    return lambda points: np.cos(points @ waves.T + phases).sum(axis=1) / np.sqrt(12)


def bumps(rng: Rng, slope: float) -> Field:
    """Displacements (n, 3) of points (n, 3)."""
    fields = [field(rng, 0.3, 3.0) for _ in range(3)]
    return lambda points: slope / (6 * np.pi) * np.stack([f(points) for f in fields], axis=-1)


def random_turn(rng: Rng, upright: bool = False) -> Rotation:
    """Any rotation, or any about z."""
    return (
        Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)]) if upright else Rotation.from_quat(rng.normal(size=4))
    )


def welded(part: RawMesh) -> RawMesh:
    """One vertex for those at one place; without faces that lose their area by it, or vertices of no face."""
    vertices, faces = part
    steps = np.round(vertices / (_SAME * np.ptp(vertices, axis=0).max())).astype(np.int64)
    _, first, group = np.unique(steps, axis=0, return_index=True, return_inverse=True)
    faces = group.reshape(-1)[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    kept, index = np.unique(faces, return_inverse=True)
    return vertices[first][kept], index.reshape(faces.shape)


def sheet(surface: Callable[[Float64s, Float64s], Float64s], *lengths: float) -> Make:
    """Points (…, 3) of s and t (…) in [0, 1] on a lattice, facing ∂s × ∂t, seams closed."""

    def make(h: float) -> RawMesh:
        rows, columns = (max(int(np.ceil(length / h)), 4) for length in lengths)
        s, t = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
        index = np.arange(s.size).reshape(s.shape)
        a, b, c, d = (corner.ravel() for corner in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
        faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
        return welded((surface(s, t).reshape(-1, 3), faces))

    return make


def rectangle(width: float, depth: float) -> Make:
    """In z = 0 about the origin, facing +z."""
    return sheet(lambda s, t: np.stack([width * (s - 0.5), depth * (t - 0.5), 0 * s], -1), width, depth)


def ball(h: float) -> RawMesh:
    """The unit sphere: a cube blown up, so that it has no poles."""
    cells = 2 * h / 1.6 if h < 1 else 1.0
    vertices, faces = welded(raw_mesh(primitives.box((0, 0, 0), (2.0, 2.0, 2.0), cells).mesh))
    vertices = np.tan(vertices * np.pi / 4)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def tube(centre: Field, radius: float) -> Make:
    """A closed pipe along a curve, points (…, 3) of s from 0 to 1; it may run through itself."""

    def surface(s: Float64s, t: Float64s) -> Float64s:
        along = centre(s + 1e-4) - centre(s - 1e-4)
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        side = np.cross(along, centre(s) + np.array([0.0, 0.0, 3.0]))
        side /= np.linalg.norm(side, axis=-1, keepdims=True)
        angle = 2 * np.pi * (t % 1.0)[..., None]
        return centre(s) + radius * (np.cos(angle) * side - np.sin(angle) * np.cross(along, side))

    steps = centre(np.linspace(0, 1, 200))
    length = float(np.linalg.norm(np.diff(steps, axis=0), axis=1).sum())
    return sheet(surface, length, 2 * np.pi * radius)


def curve(waves: Float64s) -> Field:
    """A closed one by the cosines and sines of some turns, (2, k, 3)."""

    def centre(s: Float64s) -> Float64s:
        turns = 2 * np.pi * (s % 1.0)[..., None] * np.arange(1, waves.shape[1] + 1)
        return np.cos(turns) @ waves[0] + np.sin(turns) @ waves[1]

    return centre


def moved(make: Make, shift: ArrayLike = (0, 0, 0), turn: Rotation | None = None, stretch: ArrayLike = 1.0) -> Make:
    """Stretched along the axes, then turned, then shifted."""

    def made(h: float) -> RawMesh:
        vertices, faces = make(h)
        vertices = vertices * np.asarray(stretch)
        return (vertices if turn is None else turn.apply(vertices)) + np.asarray(shift), faces

    return made


def bent(make: Make, by: Field) -> Make:
    def made(h: float) -> RawMesh:
        vertices, faces = make(h)
        return vertices + by(vertices), faces

    return made


def joined(makes: Iterable[Make]) -> Make:
    makes = list(makes)
    return lambda h: join([make(h) for make in makes])


def solid(rng: Rng, size: float) -> Make:
    """An ellipsoid, ring, knot, box or cylinder of about `size` about the origin, turned somehow or upright."""
    kind, hard, relative = rng.integers(5), bool(rng.random() < 0.5), rng.random() < 0.3
    a, b, c = rng.uniform(0.2, 1.0, 3)
    knot = 0.3 * rng.normal(size=(2, 3, 3)) / np.array([1.0, 1.6, 2.5])[:, None]
    ring = np.array([[[0.5, 0, 0]], [[0, 0.5, 0]]])

    def edged(mesh: primitives.TexturedMesh) -> RawMesh:
        return raw_mesh(mesh.mesh) if hard else welded(raw_mesh(mesh.mesh))

    make: Make = (
        lambda h: moved(ball, stretch=(a / 2, b / 2, c / 2))(2 * h),
        tube(curve(ring), 0.2 * a),
        tube(curve(knot), rng.uniform(0.04, 0.1)),
        lambda h: edged(primitives.box((0, 0, 0), (a, b, c), h)),
        lambda h: edged(primitives.cylinder(a / 2, c, h)),
    )[kind]
    turned = moved(make, turn=random_turn(rng, upright=bool(rng.random() < 0.5)), stretch=size)
    return lambda h: turned(2 * h if relative else h / size)


def ground(rng: Rng) -> tuple[Make, Field, float]:
    """Of size 1 × 1: its height z at points (n, 2), and how far from the middle things stand.

    It is flat or wavy, even or finer where things stand, or of points at random, folded along straight lines.
    """
    kind, amplitude = rng.integers(4), log_uniform(rng, 0.005, 0.08)
    waves, power, own = field(rng, 0.4, 3.0), rng.uniform(2.0, 5.0), int(rng.integers(1 << 32))
    ways, where = rng.normal(size=(6, 2)), rng.uniform(-0.4, 0.4, 6)

    def height(xy: Float64s) -> Float64s:
        if kind == 3:
            return np.maximum(xy @ (0.3 * ways.T) - where, 0).sum(axis=1)
        return amplitude * waves(np.column_stack([xy, 0 * xy[:, :1]])) if kind == 1 else np.zeros(len(xy))

    def surface(s: Float64s, t: Float64s) -> Float64s:
        xy = np.stack([s.ravel(), t.ravel()], -1) - 0.5
        if kind == 2:
            xy = np.sign(xy) * np.abs(2 * xy) ** power / 2
        return np.column_stack([xy, height(xy)]).reshape(*s.shape, 3)

    def irregular(h: float) -> RawMesh:
        places = np.random.default_rng(own)
        points = places.uniform(-0.5, 0.5, (int(1 / h**2) + 4, 2))
        crowded = places.random(len(points)) < 0.2
        points[crowded] = places.uniform(-0.4, 0.4, 2) + amplitude * places.normal(size=(int(crowded.sum()), 2))
        faces = Delaunay(points).simplices.astype(np.int64)
        a, b, c = points[faces].transpose(1, 0, 2)
        turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        faces = np.where((turn > 0)[:, None], faces, faces[:, ::-1])[np.abs(turn) > 1e-14]
        return np.column_stack([points, height(points)]), faces

    return irregular if kind == 3 else sheet(surface, 1.0, 1.0), height, 0.05 if kind == 2 else 0.48


def standing(rng: Rng, size: int) -> Make:
    """Things on a ground: exactly on it, a hair above, or sunk."""
    earth, height, reach = ground(rng)
    makes = [earth]
    for _ in range(int(log_uniform(rng, 2, 30))):
        xy, length = rng.uniform(-reach, reach, (1, 2)), log_uniform(rng, 0.02 * reach, 0.6 * reach)
        thing = solid(rng, length)
        clearance = rng.choice([0.0, log_uniform(rng, 1e-6, 1e-2), -length * rng.uniform(0.02, 0.6)])
        foot = thing(length / 8)[0][:, 2].min()
        makes.append(moved(thing, (*xy[0], float(height(xy)[0]) + clearance - foot)))
    return joined(makes)


def eyes(rng: Rng, size: int) -> Make:
    """A bumpy head with balls set into it, in sockets of their own size or just through the skin, some under lids."""
    skin_bumps = bumps(rng, rng.uniform(0.2, 1.0))
    looks = rng.normal(size=(int(rng.integers(2, 14)), 3))
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    radii = np.exp(rng.uniform(np.log(0.02), np.log(0.25), len(looks)))
    depth = radii * rng.uniform(-0.9, 0.9, len(looks))
    sockets, lids = rng.random(len(looks)) < 0.5, rng.random(len(looks)) < 0.3
    gaps = [0.0 if rng.random() < 0.4 else log_uniform(rng, 1e-5, 2e-2) for _ in looks]

    def make(h: float) -> RawMesh:
        skin, faces = bent(ball, skin_bumps)(h)
        parts: list[RawMesh] = []
        for look, radius, deep, socket, lid, gap in zip(looks, radii, depth, sockets, lids, gaps, strict=True):
            centre = look + skin_bumps(look[None])[0] - deep * look
            if socket:  # the skin is pressed onto the ball, or a gap above it
                off, within = skin - centre, radius * (1 + gap)
                far = np.linalg.norm(off, axis=1, keepdims=True)
                skin = np.where(far < within, centre + off / np.maximum(far, 1e-12) * within, skin)
            parts.append(moved(ball, centre, stretch=radius)(h / radius))
            if lid:
                cover, triangles = moved(ball, stretch=radius * (1.001 + gap))(h / radius)
                parts.append((cover + centre, triangles[(cover[triangles][:, :, 2] > 0.2 * radius).all(axis=1)]))
        return join([(skin, faces), *parts])

    return make


def blades(rng: Rng, size: int) -> Make:
    """Blades like hair or grass, thin and bent, on or through a ground; a third of the vertices or more."""
    earth, height, reach = ground(rng)
    share, steps = rng.uniform(0.3, 0.8), int(rng.integers(3, 12))
    count = max(int(share * size / (2 * steps + 2)), 20)
    xy = rng.uniform(-reach, reach, (count, 2))
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
    return joined([earth, lambda h: strips])


def character(rng: Rng, size: int) -> Make:
    """A figure of 6 to 25 solids, each through one before."""
    makes, centres = [], [np.zeros(3)]
    for _ in range(int(rng.integers(6, 26))):
        length, way = log_uniform(rng, 0.08, 0.6), rng.normal(size=3)
        parent = centres[rng.integers(len(centres))]
        centres.append(parent + way / np.linalg.norm(way) * length * rng.uniform(0.2, 0.6))
        makes.append(moved(solid(rng, length), centres[-1]))
    return joined(makes)


def layers(rng: Rng, size: int) -> Make:
    """Sheets above, shells inside, or rectangles through one another, with holes; some face the other way."""
    kind, bend = rng.integers(3), bumps(rng, rng.uniform(0.0, 3.0))
    makes, level = [], 0.0
    for _ in range(int(rng.integers(2, 9))):
        level += log_uniform(rng, 1e-5, 0.15)
        flat = rectangle(*rng.uniform(0.3, 1.0, 2))
        crossing = moved(flat, rng.normal(size=3) * 0.2, random_turn(rng))
        shell = moved(bent(ball, bend), stretch=np.exp(-level))
        makes.append(holed((moved(bent(flat, bend), (0, 0, level)), shell, crossing)[kind], rng))
    return joined(makes)


def holed(make: Make, rng: Rng) -> Make:
    """Without the faces in some balls about the surface; of either side."""
    places, count, turned = make(0.2)[0], int(rng.integers(0, 6)), rng.random() < 0.5
    centres, radii = places[rng.integers(len(places), size=count)], rng.uniform(0.0, 0.3, count)

    def made(h: float) -> RawMesh:
        vertices, faces = make(h)
        middle = vertices[faces].mean(axis=1)
        kept = (np.linalg.norm(middle[:, None] - centres, axis=2) > radii).all(axis=1)
        faces = faces[kept] if kept.any() else faces
        return vertices, faces[:, ::-1] if turned else faces

    return made


FAMILIES: dict[str, Callable[[Rng, int], Make]] = {
    each.__name__: each for each in (standing, eyes, blades, character, layers)
}


def places(part: RawMesh) -> int:
    """How many places the vertices of faces are at that differ by a millionth of the part's extent, as they do wherever
    it lies; a bake has at least as many points."""
    used = part[0][np.unique(part[1])]
    return len(np.unique(np.round(used / (1e-6 * np.ptp(part[0], axis=0).max())), axis=0))


def sized(make: Make, size: int) -> RawMesh:
    """make(fineness), so fine that it has `size` to `SURPLUS`·`size` places of vertices.

    Where the number jumps past that, the coarsest found that has `size`.
    """
    low, high, fineness, before, found = 0.0, np.inf, 0.05, 0, None
    for _ in range(24):
        part = make(fineness)
        count = places(part)
        if count >= size:
            found, low = part, max(low, fineness)
            if count <= SURPLUS * size or count == before:
                break
        else:
            high = min(high, fineness)
        guess = fineness * float(np.sqrt(count / (1.1 * size))) * (0.5 if count == before else 1.0)
        before = count
        fineness = guess if low < guess < high else float(np.sqrt(max(low, high / 8) * min(high, 8 * low)))
    if found is None:
        raise ValueError(f"no fineness down to {fineness:g} gives {size} vertices")
    return found


def draw(family: str, seed: int, size: int) -> Mesh:
    """The mesh that a family makes of `seed`, whatever other families are drawn; somewhere in space, of any scale."""
    rng = np.random.default_rng([seed, zlib.crc32(family.encode())])
    vertices, faces = sized(FAMILIES[family](rng, size), size)
    turn = Rotation.from_quat(rng.normal(size=4)) if rng.random() < 0.75 else Rotation.identity()
    scale, away = log_uniform(rng, 1e-2, 1e2), np.ptp(vertices, axis=0).max() * rng.normal(size=3)
    return Mesh(scale * (turn.apply(vertices) + away), faces, source=family)
