"""The hemispheres of a bake by other rays than its walk's: Embree's, or every triangle in double precision."""

from contextlib import contextmanager
from unittest.mock import patch

import numpy as np

from obscurance.ao.execute.tracer import Hemispheres
from obscurance.ao.mu import accumulate_occlusion, attenuation, depends_on_distance
from obscurance.ao.rays.directions import BATCHES, choose, turned_frame
from obscurance.ao.rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from obscurance.raytrace.embree import intersect
from obscurance.raytrace.mesh.opacity import alpha


@contextmanager
def traced_by(trace):
    """Bakes in this block trace by a function of a scene, an origin, its lift and directions (r, 3), which returns hits
    (ray, distance from the place, share of the ray that ends there), nearest first; see `by_embree`."""

    def gatherer(work, scene):
        table, samples = work.directions(scene), work.samples

        def gather(points, out):
            for i, row in enumerate(out):
                chosen, turn = choose(points.numbers[i], table)
                normal = points.normals[i]
                frame = np.array([*turned_frame(tuple(normal), turn), normal], np.float32)
                directions = table.directions[chosen, :, :samples].T @ frame
                loss = np.zeros((samples, len(row)))
                for ray, distance, share in trace(scene, points.origins[i], points.lifts[i], directions, work.t_max):
                    _add_loss(work.mu, distance, share, loss[ray])
                parts = [loss[table.batches == part].mean(axis=0) for part in range(min(BATCHES, samples))]
                row[:, W] = 1 - loss.mean(axis=0)
                row[:, BATCH_VARIANCE] = np.var(parts, axis=0, ddof=1) if samples > 1 else 0
                row[:, BENT:COLUMNS] = ((1 - loss).T @ directions.astype(np.float64)) / samples

        return gather

    with patch.object(Hemispheres, "gatherer", gatherer):
        yield


def _add_loss(mu, distance, share, loss):
    """Add the part of a ray that a hit takes, by each falloff."""
    if mu.columns is not None:
        accumulate_occlusion(mu.columns, distance, share, loss)
    elif distance < mu.limit:
        loss[0] += share * (1 - (attenuation(distance, mu) if depends_on_distance(mu) else 0))


def by_embree(scene, origin, lift, directions, reach):
    """Closest hits of opaque faces."""
    assert scene.opacity is None
    hits = intersect(scene.embree(), origin, directions, reach)
    corners = scene.vertices[scene.faces].astype(np.float64)
    for ray in np.flatnonzero(hits.face >= 0):
        a, b, c = corners[hits.face[ray]]
        normal = np.cross(b - a, c - a)
        ahead = directions[ray] @ normal
        beyond = (lift @ normal) / ahead if ahead else 0
        yield ray, max(hits.distance[ray] + beyond, 0), 1.0


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
    for ray in np.flatnonzero(inside.any(axis=1)):
        left = 1.0
        faces = np.flatnonzero(inside[ray])
        for face in faces[np.argsort(t[ray, faces])]:
            share = 1.0 if scene.opacity is None else alpha(scene.opacity, face, u[ray, face], v[ray, face])
            yield ray, max(from_place[ray, face], 0), left * share
            left *= 1 - share
