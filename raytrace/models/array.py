"""The models over arrays: one compiled loop for all of them."""

from __future__ import annotations

from raytrace.jit import kernel
from raytrace.models.dispatch import evaluate
from raytrace.vector import load


@kernel
def reflect_rows(kind, row, n, l, v, tangent, out):
    """Fill `out` (k, 3) with the reflected RGB of one packed material for unit vectors n, l, v, tangent (k, 3)."""
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2] = evaluate(kind, row, load(n, i), load(l, i), load(v, i), load(tangent, i))
