"""Form factor of a polygon by Lambert's formula: an exact binary truth for any scene of triangles."""

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.types import Float64s


def _clipped_to_horizon(points: Float64s, normal: Float64s) -> Float64s:
    """The part of a polygon (k, 3) in the half-space x·normal ≥ 0 (Sutherland & Hodgman 1974), (j, 3), j ≥ 0."""
    height = points @ normal
    kept: list[Float64s] = []
    for a, b, ha, hb in zip(points, np.roll(points, -1, axis=0), height, np.roll(height, -1), strict=True):
        if ha >= 0:
            kept.append(a)
        if (ha >= 0) != (hb >= 0):
            kept.append(a + (b - a) * (ha / (ha - hb)))
    return np.array(kept, dtype=np.float64).reshape(-1, 3)


def polygon_form_factor(polygon: npt.ArrayLike, point: npt.ArrayLike, normal: npt.ArrayLike) -> float:
    """Cosine-weighted part F of the hemisphere at `point` that a planar polygon covers; w = 1 − F when binary.

    F = |(1/2π) Σ Θ_i n·Γ_i|, Θ_i the angle that edge i subtends and Γ_i the unit normal of its plane through the point
    (Lambert 1760; Baum, Rushmeier & Winget 1989), after clipping to the horizon. Polygons that do not overlap as seen
    from the point add up.

    Args: polygon: (k, 3), its corners in order; it need not be convex. point: not on it. normal: any length > 0.
    """
    up = np.asarray(normal, dtype=np.float64)
    up = up / np.linalg.norm(up)
    seen = _clipped_to_horizon(np.asarray(polygon, np.float64) - np.asarray(point, np.float64), up)
    if len(seen) < 3:
        return 0.0
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    following = np.roll(seen, -1, axis=0)
    across = np.cross(seen, following)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (seen * following).sum(axis=1))
    turns = angle * np.divide(across @ up, sine, out=np.zeros_like(sine), where=sine > 0)
    return float(abs(turns.sum()) / (2 * np.pi))
