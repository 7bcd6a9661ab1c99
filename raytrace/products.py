"""Products of many rows with one small matrix, without BLAS.

OpenBLAS multiplies a few thousand rows on threads that go on spinning for some thirty milliseconds afterwards, on
cores that rays are traced on meanwhile: bakes take up to twice as long.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def product(rows: npt.NDArray[np.float64], matrix: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.float64]:
    """rows (n, k) · matrix (k,) or (k, m): (n,) or (n, m)."""
    return np.asarray(np.einsum("nk,k...->n...", rows, matrix))
