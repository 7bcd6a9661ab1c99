"""Neighbours of points that are joined by links other than the edges of triangles."""

import numpy as np
from scipy.sparse import coo_array, csr_array

from obscurance.raytrace.types import AnyInts, Float32s

from ..estimate.one_ring import Neighbours


def linked(here: AnyInts, there: AnyInts, normals: Float32s, threads: int) -> Neighbours:
    """The points joined by links from `here` (l,) to `there` (l,), both ways. Args: normals: (k, 3), unit."""
    count = len(normals)
    ends = np.concatenate([here, there]), np.concatenate([there, here])
    graph: csr_array = coo_array((np.ones(len(ends[0]), np.float32), ends), (count, count)).tocsr()
    graph.setdiag(0)
    graph.eliminate_zeros()
    starts = graph.indptr.astype(np.int64)
    indices = graph.indices.astype(np.int32)
    return Neighbours.weighted(starts, indices, np.ones(len(indices), np.float32), normals, threads)
