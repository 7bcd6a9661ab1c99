"""The hemispheres of a bake by other rays than its walk's: Embree's, or every triangle in double precision."""

from contextlib import contextmanager
from functools import lru_cache
from unittest.mock import patch

import numpy as np

from obscurance.ao.execute.tracer import Hemispheres
from obscurance.ao.mu import accumulate_occlusion, depends_on_distance
from obscurance.ao.rays.directions import BATCHES, choose, turned_frame
from obscurance.ao.rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from obscurance.raytrace.embree import TriangleScene, intersect
from obscurance.raytrace.mesh.opacity import alpha


@contextmanager
def traced_by(trace):
    """Bakes in this block trace by a function of a scene, an origin, its lift and directions (r, 3).

    It returns hits: rays (h,), distances (h,) from the place, and shares (h,) of the rays that end there.
    """

    def gatherer(work, scene):
        table, samples = work.directions(scene), work.samples

        def gather(points, out):
            for i, row in enumerate(out):
                chosen, turn = choose(points.numbers[i], table)
                normal = points.normals[i]
                frame = np.array([*turned_frame(tuple(normal), turn), normal], np.float32)
                directions = table.directions[chosen, :, :samples].T @ frame
                rays, distances, shares = trace(scene, points.origins[i], points.lifts[i], directions, work.t_max)
                loss = np.zeros((samples, len(row)))
                np.add.at(loss, rays, _occlusion(work.mu, distances, len(row)) * shares[:, None])
                parts = [loss[table.batches == part].mean(axis=0) for part in range(min(BATCHES, samples))]
                row[:, W] = 1 - loss.mean(axis=0)
                row[:, BATCH_VARIANCE] = np.var(parts, axis=0, ddof=1) if samples > 1 else 0
                row[:, BENT:COLUMNS] = ((1 - loss).T @ directions.astype(np.float64)) / samples

        return gather

    with patch.object(Hemispheres, "gatherer", gatherer):
        yield


def _occlusion(mu, distances, columns):
    """1 − μ (h, columns) at distances (h,)."""
    if mu.columns is not None:
        loss = np.zeros((len(distances), columns))
        for distance, row in zip(distances, loss, strict=True):
            accumulate_occlusion(mu.columns, distance, 1.0, row)
        return loss
    if not depends_on_distance(mu):
        open_part = np.zeros(len(distances))
    elif mu.tau > 0:
        open_part = -np.expm1(-mu.tau * distances) * mu.scale
    else:
        open_part = np.interp(distances, mu.distances, mu.values)
    return np.where(distances < mu.limit, 1 - open_part, 0.0)[:, None]


@lru_cache(1)
def _in_embree(scene):
    return TriangleScene(scene.vertices, scene.faces)


def by_embree(scene, origin, lift, directions, reach):
    """Closest hits of opaque faces."""
    assert scene.opacity is None
    hits = intersect(_in_embree(scene), origin, directions, reach)
    rays = np.flatnonzero(hits.face >= 0)
    a, b, c = scene.vertices[scene.faces[hits.face[rays]]].astype(np.float64).swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    ahead = np.einsum("hi,hi->h", directions[rays], normals)
    beyond = np.divide(normals @ lift, ahead, out=np.zeros(len(rays)), where=ahead != 0)
    return rays, np.maximum(hits.distance[rays] + beyond, 0), np.ones(len(rays))


def by_every_triangle(scene, origin, lift, directions, reach):
    """Hits of all faces, in double precision, through as many layers as there are (Möller & Trumbore 1997)."""
    corners = scene.vertices[scene.faces].astype(np.float64)
    a, ab, ac = corners[:, 0] - origin, corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(ab, ac)
    ahead = directions.astype(np.float64) @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("mi,mi->m", a, normal) / ahead
        aside = np.cross(directions[:, None], a[None])
        u = np.einsum("rmi,mi->rm", aside, ac) / -ahead
        v = np.einsum("rmi,mi->rm", aside, ab) / ahead
        from_place = t + lift @ normal.T / ahead
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t < reach)
    if scene.opacity is not None and scene.opacity.one_sided:
        inside &= ahead < 0
    rays, faces = np.nonzero(inside)
    shares, left = np.ones(len(rays)), np.ones(len(directions))
    for hit in np.argsort(t[rays, faces]):  # the nearest of a ray before its others
        ray, face = rays[hit], faces[hit]
        opaque = 1.0 if scene.opacity is None else alpha(scene.opacity, face, u[ray, face], v[ray, face])
        shares[hit] = left[ray] * opaque
        left[ray] *= 1 - opaque
    return rays, np.maximum(from_place[rays, faces], 0), shares
