"""What a bake says of its tolerance: the estimates that it ends with, and how they fall short."""

import warnings
from typing import NamedTuple

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.solids import inward_warnings
from obscurance.raytrace.types import Float32s, Float64s

from ..options import Options
from .calibration import Calibration
from .inside import holes


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


def shortfalls(
    options: Options, rmse: float, samples: int, kind: str, solid: Mesh, vertices: Float32s
) -> tuple[str, ...]:
    """The lines about what the result lacks of what was asked for.

    They name a tolerance that is not met, also in a warning of Python's, closed parts of the `solid` that look inwards,
    and holes of a `solid` whose thickness is baked.

    Args: samples: rays of the point that has most. kind: of the points, in a word. vertices: of the solid and what
        else occludes, in render space.
    """
    texts = []
    if options.tolerance is not None and rmse > options.tolerance:
        reason = f": {samples:,} rays a {kind} were allowed" if samples >= options.rays else ""
        texts = [f"tolerance {options.tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"]
        warnings.warn(texts[0], ToleranceWarning, stacklevel=5)  # whoever called `ao.bake`
    if options.thickness:
        return (*texts, *holes(solid))
    return (*texts, *inward_warnings(solid, vertices[: len(solid.vertices)]))


class Estimate(NamedTuple):
    """Values of points, and their errors."""

    values: Float64s  # (k, 4), w and the mean of μ·direction (x, y, z)
    variance: Float64s  # (k,), mean square error of w expected
    samples: int  # rays of the point that has most
    spared: int = 0  # rays that the other points have fewer than it, in all
    calibration: Calibration | None = None  # of the variances, at some of the points

    @property
    def mean_samples(self) -> int:
        """Rays of a point in the mean."""
        return self.samples - self.spared // max(len(self.values), 1)

    def skipped(self, hidden: int) -> dict[str, int]:
        """Rays not traced, by reason. Args: hidden: number of points inside solids."""
        return {"predicted": self.spared, "hidden": self.samples * hidden}
