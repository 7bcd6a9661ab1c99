"""Neighbours of points that are joined by links other than the edges of triangles."""

from functools import partial

import numpy as np
from scipy.sparse import coo_array, csr_array

from raytrace.types import AnyInts, Float32s, Int64s

from .one_ring import Neighbours, NeighboursOf


def linked(here: AnyInts, there: AnyInts, normals: Float32s, threads: int) -> NeighboursOf:
    """The points joined by links from `here` (l,) to `there` (l,), both ways. Args: normals: (k, 3), unit."""
    count = len(normals)
    ends = np.concatenate([here, there]), np.concatenate([there, here])
    graph: csr_array = coo_array((np.ones(len(ends[0]), np.float32), ends), (count, count)).tocsr()
    graph.setdiag(0)
    graph.eliminate_zeros()
    return partial(_among, graph, normals, threads)


def _among(graph: csr_array, normals: Float32s, threads: int, point_rows: Int64s) -> Neighbours:
    """The neighbours among the points of `point_rows` (k,)."""
    part = graph[point_rows][:, point_rows] if len(point_rows) < len(normals) else graph
    starts = part.indptr.astype(np.int64)
    indices = part.indices.astype(np.int32)
    return Neighbours.weighted(starts, indices, np.ones(len(indices), np.float32), normals[point_rows], threads)
