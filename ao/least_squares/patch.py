"""The faces over which w is fitted, and the gathering of their moments, block by block."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from obscurance.raytrace.mesh.morton import fine_morton_order
from obscurance.raytrace.mesh.normals import face_normals
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.weld import CREASE, connected_components
from obscurance.raytrace.sampling import hash32_array
from obscurance.raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..execute.tracer import Hemispheres
from ..execute.work import Outputs
from ..mu import columns_in_render_space
from ..points.points import Points
from ..points.receivers import Receivers
from ..prepared import Prepared
from ..rays.directions import RUN
from ..rays.gather import WIDER
from ..rays.ray_scene import RayScene
from .face_moments import SEEN, Faces, Samples, add_moments, columns, place_samples
from .pattern import find_hinges

_FEWEST_RAYS, _MOST_RAYS = 8, 32  # of a sample
_PLACED = 1 << 12  # samples whose rays are traced together
_HIDDEN = 1e-4  # weight of a sample that sees backs of faces; not 0, so that hidden faces have a value too
_COARSE = 1 << 16  # faces; with more, how rectangles are cut is no longer seen
_SQUARE = 1e-4  # of a rectangle's diagonal


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces in render space, in Morton order; at the end the faces of rectangles again, cut by the other diagonal.

    A fit to the two halves of a rectangle alone would raise or lower the ends of its diagonal.
    """

    corners: Float64s  # (m, 3, 3)
    normals: Float64s  # (m, 3), unit, on the faces' fronts
    areas: Float64s  # (m,), above 0
    face_points: Int32s  # (m, 3), unknowns: rows in `Receivers.points`, or behind them for vertices without a point
    axes: Float32s  # (m, 3, 3), unit axes of the corners' points, or 0
    smooth: Float32s  # (m, 3, 3), normals of the smooth surface at these, or 0
    unknowns: int  # their number
    mesh_faces: int  # number of faces that are the mesh's
    cover: Float64s  # (m,), the share of each face's area that it stands for: half in rectangles

    @classmethod
    def of(cls, placement: Placement, receivers: Receivers, requested: Bools) -> Patch:
        """The patch of all faces with a corner among the `requested` vertices, bool (n,)."""
        vertices = placement.vertices.astype(np.float64)
        rows = np.flatnonzero(requested[receivers.faces].any(axis=1))
        rows = rows[fine_morton_order(vertices[receivers.faces[rows]].mean(axis=1))]
        faces = receivers.faces[rows]
        normals_of, areas = face_normals(vertices, faces)
        normals_of[receivers.backwards[rows]] *= -1.0
        unknown = receivers.of_vertex.copy()
        normals = receivers.points.normals
        without = np.flatnonzero(unknown < 0)
        unknown[without] = len(normals) + np.arange(len(without))
        none = np.zeros((len(without), 3), np.float32)
        axes = np.concatenate([normals, none])
        points = unknown[faces]
        patch = cls(
            vertices[faces],
            normals_of,
            areas,
            points.astype(np.int32),
            axes[points],
            np.concatenate([receivers.surface_normals, none])[points],
            unknowns=len(axes),
            mesh_faces=len(faces),
            cover=np.broadcast_to(1.0, len(faces)),
        )
        return patch if len(faces) > _COARSE else patch._with_rectangles()

    def _with_rectangles(self) -> Patch:
        """The patch with the other cut of every rectangle that two faces form; each cut has half the samples."""
        # Pairs of faces at a smooth edge, their diagonal: the corners opposite to it, and its ends.
        hinges = find_hinges(self.face_points, self.normals, CREASE, self.unknowns).astype(np.int64)
        opposite, across = hinges.T
        face = opposite // 3
        start = 3 * face + (opposite + 1) % 3
        end = 3 * face + (opposite + 2) % 3
        # Those of four right angles: both diagonals have one middle and one length.
        at = self.corners.reshape(-1, 3)
        length = np.linalg.norm(at[start] - at[end], axis=1)
        other_length = np.linalg.norm(at[opposite] - at[across], axis=1)
        crooked = np.linalg.norm(at[opposite] + at[across] - at[start] - at[end], axis=1)
        is_square = np.abs(other_length - length) <= _SQUARE * length
        cut = np.flatnonzero(is_square & (crooked <= _SQUARE * length))
        # Two faces more of each, by the other diagonal.
        turned = np.stack([opposite, start, across, opposite, across, end], axis=1)[cut].reshape(-1, 3)
        face = np.repeat(face[cut], 2)
        cover = np.ones(len(self.normals) + len(face))
        cover[hinges[cut] // 3] = cover[len(self.normals) :] = 0.5
        return replace(
            self,
            corners=np.concatenate([self.corners, at[turned]]),
            normals=np.concatenate([self.normals, self.normals[face]]),
            areas=np.concatenate([self.areas, self.areas[face]]),
            face_points=np.concatenate([self.face_points, self.face_points.ravel()[turned]]),
            axes=np.concatenate([self.axes, self.axes.reshape(-1, 3)[turned]]),
            smooth=np.concatenate([self.smooth, self.smooth.reshape(-1, 3)[turned]]),
            cover=cover,
        )

    def part(self, faces: Int64s) -> Patch:
        """A patch of some faces, with unknowns of their own."""
        unknowns, renumbered = np.unique(self.face_points[faces], return_inverse=True)
        face_points = renumbered.reshape(-1, 3).astype(np.int32)
        return Patch(
            self.corners[faces],
            self.normals[faces],
            self.areas[faces],
            face_points,
            self.axes[faces],
            self.smooth[faces],
            unknowns=len(unknowns),
            mesh_faces=len(faces),
            cover=self.cover[faces],
        )


@dataclass(frozen=True, eq=False)
class Moments:
    """The moments and ray counts of faces as a `KeptRowTask`, which any process can do; see `add_moments`."""

    hemispheres: Hemispheres  # as they are gathered at samples, at no points yet
    faces: Faces
    samples: Samples
    points: Int32s  # (m, 3), unknowns, which identify the faces
    count: int  # of samples in all
    hidden_weight: float
    block_rays: ClassVar = 1 << 19

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> Moments:
        start, stop, _ = rows.indices(len(self))
        shift, ends, starts, weights = self.samples
        samples = Samples(shift, ends[start : stop + 1], starts[start : stop + 1], weights[rows])
        faces = Faces._make(array[rows] for array in self.faces)
        return replace(self, faces=faces, samples=samples, points=self.points[rows])

    @property
    def name(self) -> bytes:
        """A `KeptRowTask.name`, by the samples' count, key and places."""
        digest = hashlib.blake2b(repr((self.count, int(self.hemispheres.key))).encode(), digest_size=16)
        digest.update(np.ascontiguousarray(self.points).data)
        return digest.digest()

    @property
    def rays(self) -> float:
        """Rays of a face on average, as `RowTask.rays`."""
        count = int(self.samples.starts[-1] - self.samples.starts[0])
        return self.hemispheres.samples * count / max(len(self), 1)

    def tables(self) -> Outputs:
        return np.zeros((len(self), columns(*self.hemispheres.mu.shape))), np.zeros((len(self), 3), np.int64)

    def writer(self, scene: RayScene, tables: Outputs) -> Callable[[int, int], None]:
        gather = self.hemispheres.gatherer(scene)
        falloffs = self.hemispheres.mu.shape
        directions = self.hemispheres.samples, scene.lobe

        def write(start: int, stop: int) -> None:
            part = self[start:stop]
            of_part = [table[start:stop] for table in tables]
            last = int(part.samples.starts[-1])
            for first in range(int(part.samples.starts[0]), last, _PLACED):
                count = min(last - first, _PLACED)
                points = Points.empty(count)
                cosines = np.empty((count, 2))
                gathered = np.empty((count, *falloffs, WIDER))
                place_samples(first, first + count, part.faces, part.samples, points.arrays, cosines)
                gather(points, gathered)
                add_moments(first, part.samples, gathered, cosines, directions, self.hidden_weight, *of_part)

        return write


class Gathered(NamedTuple):
    """What `gather_moments` finds on the m faces of a patch; see `add_moments`."""

    moments: Float64s
    counts: Int64s
    hidden: Bools  # (n,), unknowns of faces that have samples, all of which are hidden
    buried: Bools  # (n,), those around which nothing is in sight, though something is that edges lead to


def gather_moments(prepared: Prepared, patch: Patch, total: int) -> Gathered:
    """The moments of the faces of `patch` from `total` rays.

    Hidden samples count next to nothing beside visible ones of the same vertex, but fully on faces of which no vertex
    has one: a room whose walls face outwards has none but hidden ones. With `--interior fill` such faces count only
    where no edges lead from them to visible ones.
    """
    placement = prepared.placement
    progress = prepared.progress
    options = prepared.options
    # Many samples of few rays each, spread evenly over the faces.
    rays = int(np.clip(options.rays // 2 // _FEWEST_RAYS * _FEWEST_RAYS, _FEWEST_RAYS, _MOST_RAYS))
    count = max(total // rays, 1)
    mu = columns_in_render_space(prepared.mus, placement.scale)
    hemispheres = Hemispheres(Points.empty(0), rays, prepared.key, count, mu, placement.diagonal, RUN, True)
    if not len(patch.face_points):
        nothing = np.zeros(patch.unknowns, np.bool_)
        return Gathered(np.zeros((0, columns(*mu.shape))), np.zeros((0, 3), np.int64), nothing, nothing)
    shift = float(np.ldexp(hash32_array([prepared.key])[0], -32))
    faces = Faces(patch.corners, patch.normals, patch.axes, patch.smooth)
    samples = Samples.spread(patch.areas * patch.cover, count, shift)
    through = options.interior == "auto" and options.back_faces == "ignore"  # backs are as if not there
    hidden_weight = 1.0 if options.interior == "ignore" or through else _HIDDEN
    work = Moments(hemispheres, faces, samples, patch.face_points, count, hidden_weight)
    done = 0

    def advance(finished: int) -> None:
        nonlocal done
        done += finished
        if progress:
            progress(count * rays * done // len(work), count * rays, "rays")

    moments, counts = prepared.checkpoint.fill(work, prepared.scene, prepared.threads, advance)
    # Faces of which no vertex is seen keep what hidden samples say, or get what the nearest that are seen have.
    sampled, seen = np.zeros((2, patch.unknowns), np.bool_)
    sampled[patch.face_points[np.diff(samples.starts) > 0]] = True
    seen[patch.face_points[counts[:, SEEN] > 0]] = True
    unseen = ~seen[patch.face_points].any(axis=1)
    moments[unseen] /= hidden_weight
    part = connected_components(patch.face_points.astype(np.int64), patch.unknowns)
    is_seen_in_part = np.zeros(patch.unknowns, np.bool_)
    is_seen_in_part[part[seen]] = True
    buried = ~seen & is_seen_in_part[part]
    if options.interior == "fill":
        moments[unseen & buried[patch.face_points[:, 0]]] = 0
    return Gathered(moments, counts, sampled & ~seen, buried)
