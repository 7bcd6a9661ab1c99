"""Special functions that the closed forms of obscurance are written in."""

import numpy as np
import numpy.typing as npt
from scipy.special import expn

from raytrace.types import Float64s

# With cosθ = 1/cosh u the integrand is analytic for |Im u| < π/2, so the trapezoidal rule errs by e^(−π²/step) ≈ 1e-17
# (Trefethen & Weideman 2014, "The exponentially convergent trapezoidal rule", theorem 5.1).
_STEP = 0.25
_U = np.arange(0.0, 40.0, _STEP)
_COSH = np.cosh(_U)
_WEIGHTS = np.where(_U == 0.0, _STEP / 2, _STEP)


def bickley(n: int, x: npt.ArrayLike) -> Float64s:
    """Bickley–Naylor function Ki_n(x) = ∫₀^{π/2} e^(−x/cosθ) cos^{n−1}θ dθ (DLMF 10.43.11).

    Args:
        n: order, n ≥ 1.
        x: x ≥ 0, any shape.

    Returns:
        float64, the shape of x; absolute error below 1e-13.
    """
    depth = np.minimum(np.asarray(x, dtype=np.float64)[..., None] * _COSH, 700.0)  # e^(−700) is nil, and no underflow
    return np.asarray(np.exp(-depth) @ (_WEIGHTS / _COSH**n), dtype=np.float64)


def shell(tau: float, near: npt.ArrayLike, far: npt.ArrayLike, power: int = 0) -> Float64s:
    """Attenuated depth integral ∫_near^far e^(−τt) tⁿ near² t⁻³ dt of a plane seen at distances near to far.

    It is the inner integral of (1/π)∫ e^(−τd) cosθ dω both for a plane facing the normal at distance `near`
    (t = near/cosθ, cosθ sinθ dθ = near² t⁻³ dt) and, at one azimuth, for a plane containing it (t = near/sinθ).

    Args:
        tau: rate τ ≥ 0 in 1/length; 0 leaves ½(1 − near²/far²).
        near: distance of the plane along the ray of least distance, > 0, any shape.
        far: distance where the plane, or the search, ends; ≥ near, ∞ allowed; broadcasts against near.
        power: n, 0 to 3; above 0 with τ = 0 and a finite `far` only.

    Returns:
        float64, E3(τ near) − (near/far)² E3(τ far) for n = 0, the broadcast shape.
    """
    near, far = np.broadcast_arrays(np.asarray(near, np.float64), np.asarray(far, np.float64))
    if power == 2:
        return np.asarray(near**2 * np.log(far / near), np.float64)
    if power:
        return np.asarray(near**2 * (far ** (power - 2) - near ** (power - 2)) / (power - 2), np.float64)
    ratio = np.where(np.isinf(far), 0.0, near / far)
    beyond = np.where(np.isinf(far), 0.0, expn(3, tau * np.where(np.isinf(far), 0.0, far)))
    return np.asarray(expn(3, tau * near) - ratio**2 * beyond, dtype=np.float64)
