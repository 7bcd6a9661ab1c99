"""What is inside a solid: points near closed parts that see backs of faces by most of their rays; samples outside."""

from collections.abc import Callable
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from obscurance.raytrace.embree import (
    DIR_X,
    END,
    FILTER_PATH,
    GEOM_ID,
    ID,
    INVALID,
    LANES,
    NG_X,
    ORG_X,
    PRIM_ID,
    ROOM,
    TFAR,
    filtered,
    intersect8,
    intersect16,
    new_packet,
)
from obscurance.raytrace.kernel.jit import called_back, inline, kernel
from obscurance.raytrace.kernel.vector import column
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.morton import fine_morton_order
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.solids import closed_parts
from obscurance.raytrace.mesh.weld import coincident, connected_components
from obscurance.raytrace.sampling import derive, hash32, hash32_array
from obscurance.raytrace.system.parallel import parallel
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import AnyInts, Bools, Float32Rows, Float32s, Int32s, Int64s

from ..options import Interior
from ..points.points import PointArrays, Points
from ..points.receivers import Receivers
from ..points.surface_samples import SurfaceSamples
from ..rays.directions import DirectionTable, choose, turned_frame

RAYS = 2 * LANES
_COUNT, _PASSED = ROOM, ROOM + 1  # rows of a packet: how many solids a ray has entered, and which
_KEY = np.uint32(0x51DE)
_DRAWING = 1 << 14  # points that the sets of directions are for
_BLOCK, _NEAR, _MOST = 1 << 7, 1 << 9, 16  # points, and blocks at once
_SEVERAL = 16  # samples of a site that is in a solid in part, at least: w changes most where solids meet
_DECIDING, _OF_PART = 16, 4  # places by which a site is cut, or hidden, for any seed alike; of a part, at least
_ATTEMPTS, _MOST_DRAWN = 6, 1 << 12  # at samples outside: 1, 2, 4, … parts of a site's, of so many samples at most
_sought: WeakKeyDictionary[Receivers, tuple[Int64s, Bools]] = WeakKeyDictionary()


def inside_solids(
    points: Points,
    vertex: Callable[[], AnyInts],
    placement: Placement,
    receivers: Receivers,
    interior: Interior,
    threads: int,
) -> Bools:
    """The points (k,) that are inside a solid as the option `interior` defines it: where over half of their rays end
    on the back of a face, past solids that they enter before. Every bake of a mesh agrees, whatever its seed and
    whichever points it is asked for.

    Args: vertex: gives a vertex (k,) of the part that each point belongs to.
    """
    count, faces, opacity = len(points), receivers.faces, receivers.opacity
    inside = np.zeros(count, np.bool_)
    candidates = np.arange(count)
    own_part = np.full(count, -1)
    if interior == "ignore" or not count:
        return inside
    if interior == "auto":
        part, closed = _closed_parts(placement.vertices, receivers)
        if not closed.any():
            return inside
        own_part = part[vertex()]
        candidates = _meeting_boxes(points.origins, points.origins, own_part, placement.vertices, part, closed, threads)
        hiding = np.where(closed[part], part, -1)[faces[:, 0]]
    else:
        hiding = np.zeros(len(faces), np.int64)
        if opacity:
            hiding[opacity.of >= 0] = -1
    if not len(candidates):
        return inside
    scene = receivers.embree()
    hidden = np.empty(len(candidates), np.bool_)
    table = DirectionTable.make(RAYS, _DRAWING, _KEY)
    past_solids = pass_solids.callback(hiding)

    def work(start: int, stop: int) -> None:
        some = candidates[start:stop]
        packets = new_packet(), new_packet(RAYS, hit_filter=past_solids)
        solids = hiding, own_part[some], placement.diagonal
        _find_hidden(scene.handle, packets, points[some].arrays, table, solids, hidden[start:stop])

    run_blocks(len(candidates), _BLOCK, work, threads, most=_MOST)
    inside[candidates] = hidden
    return inside


def near_solids(samples: SurfaceSamples, placement: Placement, receivers: Receivers, threads: int) -> Bools:
    """The groups of samples (k,) that a closed part may cut which is not their own: boxes around all that samples are
    spread over meet its box."""
    near = np.zeros(len(samples), np.bool_)
    part, closed = _closed_parts(placement.vertices, receivers)
    if closed.any() and len(near):
        low, high = (bound.reduceat(samples.points.origins, samples.starts[:-1]) for bound in (np.minimum, np.maximum))
        beyond = (high - low).max(axis=1, keepdims=True)
        own_part = part[receivers.faces[samples.face[samples.starts[:-1]], 0]]
        near[_meeting_boxes(low - beyond, high + beyond, own_part, placement.vertices, part, closed, threads)] = True
    return near


class OutsideSampler(NamedTuple):
    """Makes samples of sites outside of solids.

    Attributes:
        draw: makes samples of some sites (n,), by parts (n,) of a sequence that is even over each and shifted by a key;
            and says which of the n have any, ascending.
        is_inside: says which samples (p,) are inside. are_near: which groups of samples (k,) solids may cut.
    """

    draw: Callable[[Int64s, Int64s, np.uint32], tuple[SurfaceSamples, Int64s]]
    is_inside: Callable[[SurfaceSamples], Bools]
    are_near: Callable[[SurfaceSamples], Bools]

    def settle(self, sites: Int64s, samples: SurfaceSamples, key: np.uint32) -> tuple[SurfaceSamples, Bools, Bools]:
        """The samples that all `sites` (k,) have, out of solids; which are cut by solids, whose samples are moved; and
        which are hidden, whose samples stay.

        Places that are the same for every seed decide: if a site's own did, those of cut sites that all happen to lie
        outside would stay, and have too much of what is near the solid. Hidden are sites of which none of these is
        outside.
        """
        inside = self.is_inside(samples)
        cut, seen = np.zeros((2, len(samples)), np.bool_)
        cut[samples.groups_with(inside)] = True
        some = np.flatnonzero(cut | self.are_near(samples))
        if len(some):
            some, parts = _first_parts(some, _deciding_parts(samples.counts[some]))
            drawn, of = self.draw(sites[some], parts, _KEY)
            within = self.is_inside(drawn)
            cut[some[of[drawn.groups_with(within)]]] = True
            seen[some[of[drawn.groups_with(~within)]]] = True
        hidden = cut & ~seen
        cut &= seen
        return self._moved(samples, inside, cut, sites, 0 * sites, key)[0], cut, hidden

    def elsewhere(
        self, sites: Int64s, parts: Int64s, key: np.uint32, cut: Bools, hidden: Bools
    ) -> tuple[SurfaceSamples, Int64s]:
        """Samples of sites (n,) as `draw` makes them, but out of solids, and which of the n have any.

        Args: cut, hidden: (n,), as `settle` found them.
        """
        samples, of = self.draw(sites, parts, key)
        inside = self.is_inside(samples)
        moved = cut[of]
        moved[samples.groups_with(inside)] = True
        samples, found = self._moved(samples, inside, moved & ~hidden[of], sites[of], parts[of], key)
        return (samples, of) if found.all() else (samples.only(np.flatnonzero(found)), of[found])

    def _moved(
        self, samples: SurfaceSamples, inside: Bools, moved: Bools, sites: Int64s, parts: Int64s, key: np.uint32
    ) -> tuple[SurfaceSamples, Bools]:
        """The samples of `sites` (k,), where these are `moved` (k,) others, `_SEVERAL` or more, that are drawn until
        enough are outside, or, where few are, these over and over; and which sites have any outside (k,).

        Args: inside: (p,), samples.
        """
        some = np.flatnonzero(moved)
        found_any = np.ones(len(samples), np.bool_)
        if not len(some):
            return samples, found_any
        found_any[some] = False
        # Samples of these sites, `outside` or not, their own and then others, and the row in `some` of each.
        pool, counts = samples.only(some), samples.counts[some]
        wanted = np.maximum(counts, _SEVERAL)
        outside = ~inside[np.repeat(~found_any, samples.counts)]
        row = np.repeat(np.arange(len(some)), counts)
        for attempt in range(_ATTEMPTS + 1):
            is_last = attempt == _ATTEMPTS  # where there is nothing yet, among the places that do not depend on a seed
            times = _deciding_parts(counts) if is_last else np.full(len(some), 1 << attempt)
            short = np.bincount(row[outside], minlength=len(some)) < (1 if is_last else wanted)
            drawing = np.flatnonzero(short & (times * counts <= _MOST_DRAWN))
            if not len(drawing):
                continue
            of_part, others = _first_parts(drawing, times[drawing])
            if not is_last:
                others += parts[some[of_part]] << attempt
            keys = others, _KEY if is_last else derive(key, attempt)
            drawn, of = self.draw(sites[some[of_part]], *keys)
            pool = pool.followed_by(drawn)
            outside = np.append(outside, ~self.is_inside(drawn))
            row = np.append(row, np.repeat(of_part[of], drawn.counts))
        # A systematic sample of those outside, along a curve from a random start: even over the site and its layers.
        usable = np.flatnonzero(outside)
        usable = usable[fine_morton_order(pool.points.origins[usable])]
        usable = usable[np.argsort(row[usable], kind="stable")]
        found = np.bincount(row[usable], minlength=len(some))
        some, first, found, wanted = (each[found > 0] for each in (some, np.cumsum(found) - found, found, wanted))
        found_any[some] = True
        settled = samples.resized(some, wanted)
        settled.all_count[some] |= wanted == _SEVERAL
        start = np.ldexp(hash32_array(hash32_array(sites[some]) ^ hash32_array(parts[some]) ^ key), -32)
        rank = np.arange(wanted.sum()) - np.repeat(np.cumsum(wanted) - wanted, wanted)
        chosen = (np.repeat(start, wanted) + rank) * np.repeat(found / wanted, wanted)
        rows = np.repeat(settled.starts[some], wanted) + rank
        settled.put(rows, pool, usable[np.repeat(first, wanted) + chosen.astype(np.int64)])
        return settled, found_any


def _deciding_parts(counts: Int64s) -> Int64s:
    """How many parts (k,) of sites' places are enough to decide on, of so many samples each, `counts` (k,)."""
    return -(-_DECIDING // np.maximum(counts, _OF_PART))


def _first_parts(sites: Int64s, counts: Int64s) -> tuple[Int64s, Int64s]:
    """Each of `sites` (k,) as often as `counts` (k,) say, (n,), and the number of the part 0, 1, … of each time."""
    return np.repeat(sites, counts), np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def _closed_parts(vertices: Float32s, receivers: Receivers) -> tuple[Int64s, Bools]:
    """`_solids`, sought once for the same receivers; parts that have faces with alpha are open."""
    if receivers not in _sought:
        point, rest = receivers.of_vertex, np.flatnonzero(receivers.of_vertex < 0)  # welded vertices count once
        number = point.astype(np.int32)
        number[rest] = np.arange(len(receivers.points), len(receivers.points) + len(rest))
        if len(receivers.points) + len(rest) == len(number):  # no two vertices are one point
            part, closed = _solids(vertices, receivers.faces)
        else:
            part, closed = _solids(vertices[np.append(receivers.first_vertex, rest)], number[receivers.faces])
            part = part[number]
        if receivers.opacity:
            closed[part[receivers.faces[receivers.opacity.of >= 0]]] = False
        _sought[receivers] = part if closed.any() else part[:0].copy(), closed
    return _sought[receivers]


@called_back(*FILTER_PATH)
def pass_solids(call: int, of_face: Int64s) -> None:
    """Embree's filter, as `filtered` has it: hits of solids that a ray has entered before are none.

    Args: of_face: the part (m,) that each face bounds.
    """
    valid, rays, hits, packet = filtered(call)
    entered = packet.view(np.int32)
    for k in range(len(valid)):
        lane = rays.view(np.int32)[ID, k]
        for row in range(_PASSED, _PASSED + entered[_COUNT, lane]):
            if valid[k] != 0 and entered[row, lane] == of_face[hits.view(np.int32)[PRIM_ID - NG_X, k]]:
                valid[k] = 0


@kernel
def _find_hidden(
    scene: np.uint64,
    packets: tuple[tuple[Float32Rows, Int32s], tuple[Float32Rows, Int32s]],
    points: PointArrays,
    table: DirectionTable,
    solids: tuple[Int64s, Int64s, float],
    hidden: Bools,
) -> None:
    """Whether over half of each point's rays end on the back of a face, bool (k,); no more are traced than decide.
    Their directions are drawn by where the point is.

    Args: packets: of LANES rays, and of RAYS with `pass_solids`. solids: the part (m,) that each face bounds, −1 for
        none; the part (k,) of each point, whose faces do not hide it; the rays' length.
    """
    of_face, of_point, reach = solids
    (rays, valid), (all_rays, waiting) = packets
    ids, entered = rays.view(np.int32), all_rays.view(np.int32)
    directions = table.directions
    bits = points.origins.view(np.uint32)
    for i in range(len(points.origins)):
        number = np.uint32(0)
        for axis in range(3):
            number = hash32(number ^ bits[i, axis])
        chosen, turn = choose(number, table)
        n = points.normals[i]
        t, b = turned_frame(n, turn)
        frame = t, b, (n[0], n[1], n[2])
        backs, entering = 0, 0
        for first_ray in range(0, RAYS, LANES):
            if 2 * backs > RAYS or 2 * (backs + entering + RAYS - first_ray) <= RAYS:
                break
            _aim(rays, points.origins[i], frame, directions[chosen], first_ray)
            rays[TFAR] = reach
            intersect8(scene, rays, valid)
            for lane in range(LANES):
                side = _side(rays, lane, of_face, of_point[i])
                backs += side > 0
                entering += side < 0
                entered[_PASSED, first_ray + lane] = of_face[ids[PRIM_ID, lane]] if side < 0 else -1
        if 2 * backs <= RAYS < 2 * (backs + entering):  # other solids may be in the way of the backs
            _aim(all_rays, points.origins[i], frame, directions[chosen], 0)
            for lane in range(RAYS):
                entered[_COUNT, lane], waiting[lane] = 1, -(entered[_PASSED, lane] >= 0)
            backs += _backs_past_solids(scene, all_rays, waiting, backs, (of_face, of_point[i], reach))
        hidden[i] = 2 * backs > RAYS


@inline
def _aim(rays, origin, frame, directions, first_ray):
    """Write rays of a point to a packet, of directions (3, RAYS) from `first_ray` on in a frame about its normal."""
    t, b, n = frame
    for lane in range(rays.shape[1]):
        x, y, z = column(directions, 0, 1, first_ray + lane)
        for axis in range(3):
            rays[ORG_X + axis, lane] = origin[axis]
            rays[DIR_X + axis, lane] = x * t[axis] + y * b[axis] + z * n[axis]


@inline
def _side(rays, lane, of_face, own_part):
    """1 where a ray has met the back of a solid, −1 its front, 0 nothing or something that hides nothing."""
    ids = rays.view(np.uint32)
    if ids[GEOM_ID, lane] == INVALID:
        return 0
    part = of_face[ids[PRIM_ID, lane]]
    if part < 0 or part == own_part:
        return 0
    along = np.float32(0.0)
    for axis in range(3):
        along += rays[DIR_X + axis, lane] * rays[NG_X + axis, lane]
    return 1 if along > 0.0 else -1


@inline
def _backs_past_solids(scene, rays, waiting, backs, solids):
    """How many of the `waiting` rays meet the back of a solid before its front, whichever others they enter first; as
    many as decide with the `backs` that there are. Args: solids: see `_find_hidden`, of one point."""
    of_face, own_part, reach = solids
    entered = rays.view(np.int32)
    found, left = 0, -waiting.sum()
    while 2 * (backs + found) <= RAYS < 2 * (backs + found + left):
        rays[TFAR] = reach
        intersect16(scene, rays, waiting)
        for lane in range(RAYS):
            if waiting[lane] == 0:
                continue
            side = _side(rays, lane, of_face, own_part)
            found += side > 0
            row = _PASSED + entered[_COUNT, lane]
            if side < 0 and row < END:
                entered[row, lane] = of_face[entered[PRIM_ID, lane]]
                entered[_COUNT, lane] += 1
            else:
                waiting[lane] = 0
                left -= 1
    return found


def _solids(vertices: Float32s, faces: Int32s) -> tuple[Int64s, Bools]:
    """The part (n,) of each vertex, and whether each is closed and looks outwards; one part alone counts as open."""
    part = connected_components(faces, len(vertices))
    of_face = part[faces[:, 0]] if part.any() else part
    if (of_face == of_face[:1]).all():  # the usual case, found soonest
        return part, np.zeros(int(part.max(initial=-1)) + 1, np.bool_)
    part, volume = closed_parts(vertices, faces, alone=False)
    return part, volume > 0


def holes(mesh: Mesh) -> list[str]:
    """A line about open edges of a `mesh` whose thickness is baked, those at which more faces run one way than the
    other; vertices at the same place are one."""
    corners = coincident(Placement.of(mesh).vertices, mesh.faces)[mesh.faces]
    a = corners.ravel()
    b = corners[:, [1, 2, 0]].ravel()
    edge = np.unique(np.minimum(a, b) * len(mesh.vertices) + np.maximum(a, b), return_inverse=True)[1]
    open_edges = np.count_nonzero(np.bincount(edge, np.sign(b - a)))
    text = "edges are open: where rays leave through holes, the mesh counts as thick; close them, or limit the distance"
    return [f"{mesh.source}: {open_edges:,} {text}"] if open_edges else []


def _meeting_boxes(
    low: Float32s, high: Float32s, own_part: Int64s, vertices: Float32s, part: Int64s, closed: Bools, threads: int
) -> Int64s:
    """Rows, ascending, of boxes from `low` to `high` (k, 3), points if these are the same, that meet the bounding box
    of a closed part other than their `own_part` (k,).

    Args: low, high: along a curve, for speed. vertices: (n, 3). part, closed: of `_solids`.
    """
    part_low = np.full((len(closed), 3), np.inf, np.float32)
    part_high = np.full((len(closed), 3), -np.inf, np.float32)
    _bound(vertices, part, part_low, part_high)
    numbers = np.flatnonzero(closed)
    meeting = np.zeros(len(low), np.bool_)
    _mark_meeting.on(threads)(low, high, own_part, (numbers, part_low[numbers], part_high[numbers]), meeting)
    return np.flatnonzero(meeting)


@kernel
def _bound(vertices: Float32Rows, part: Int64s, low: Float32Rows, high: Float32Rows) -> None:
    """Grow the bounding box of each part to hold its vertices."""
    for i in range(len(vertices)):
        for axis in range(3):
            low[part[i], axis] = min(low[part[i], axis], vertices[i, axis])
            high[part[i], axis] = max(high[part[i], axis], vertices[i, axis])


@parallel("low", _NEAR)
def _mark_meeting(
    start: int,
    stop: int,
    low: Float32Rows,
    high: Float32Rows,
    own_part: Int64s,
    parts: tuple[Int64s, Float32Rows, Float32Rows],
    meeting: Bools,
) -> None:
    """Set `meeting` of boxes that meet one of `parts`, by numbers, low and high corners, but their `own_part`."""
    numbers, part_low, part_high = parts
    near = np.empty(len(numbers), np.int64)
    around = np.empty((2, 3), np.float32)
    for begin in range(start, stop, _NEAR):
        end, count = min(begin + _NEAR, stop), 0
        around[0], around[1] = np.inf, -np.inf
        for i in range(begin, end):
            for axis in range(3):
                around[0, axis] = min(around[0, axis], low[i, axis])
                around[1, axis] = max(around[1, axis], high[i, axis])
        for k in range(len(numbers)):
            if _boxes_meet(around[0], around[1], part_low[k], part_high[k]):
                near[count] = k
                count += 1
        for i in range(begin, end):
            for k in near[:count]:
                if numbers[k] != own_part[i] and _boxes_meet(low[i], high[i], part_low[k], part_high[k]):
                    meeting[i] = True
                    break


@inline
def _boxes_meet(low, high, other_low, other_high):
    """Whether two boxes have a point in common."""
    x = low[0] <= other_high[0] and high[0] >= other_low[0]
    y = low[1] <= other_high[1] and high[1] >= other_low[1]
    return x and y and low[2] <= other_high[2] and high[2] >= other_low[2]
