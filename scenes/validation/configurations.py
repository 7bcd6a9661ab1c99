"""Validation configurations: a mesh, some of its vertices, and the exact w there.

Infinite and round geometry has finite stand-ins, and each says by how much its own w may differ from the closed form:

* Truncation: directions of cosine weight `missing` meet the infinite geometry but not the stand-in, all at distances
  ≥ `beyond`; so w differs by at most missing · (1 − μ(beyond)).
* Tessellation: the stand-in lies between the true shape and a smaller (or larger) one whose w, `bracket`, is known as
  well; so w differs by at most the difference of the two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.ao.closed_forms import Rate
from obscurance.ao.falloff import POLYNOMIALS, Binary, Exponential, Falloff
from obscurance.ao.options import Normals
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Float64s, Int64s

from ..geometry.polyhedra import RawMesh, generic_rotation

ClosedForm = Callable[[Rate, float], npt.ArrayLike]

BOTH: tuple[Falloff, ...] = (Binary(), Exponential(tau=1.0))
BINARY_TARGET, EXPONENTIAL_TARGET, ZERO_VARIANCE_TARGET = 0.004, 0.001, 1e-6
SAMPLES = 4096  # that the targets are meant for
MOST_SAMPLES = 16384  # beyond which they fall no more
BINARY_RATE, EXPONENTIAL_RATE = 0.75, 0.85  # the powers of the number of rays by which they fall


@dataclass(frozen=True, eq=False)
class ValidationCase:
    """A scene of known w, for any falloff in `falloffs`.

    Attributes:
        name: what the closed form is of. mesh: the stand-in. points: int64 (k,), the vertices whose w is known.
        exact: (`Rate`, max_distance) → w, (k,) or one number for all.
        normals, options: as `ao.bake` takes them.
        missing, beyond: see the module; 0 and ∞ for geometry that is finite already.
        bracket: (`Rate`, max_distance) → w of the other bound of the tessellation, or None for flat geometry.
        certain: μ is the same in all directions, so that the estimate has no variance.
    """

    name: str
    mesh: Mesh
    points: Int64s
    exact: ClosedForm
    falloffs: tuple[Falloff, ...]
    normals: Normals = "angle"
    missing: float = 0.0
    beyond: float = inf
    bracket: ClosedForm | None = None
    certain: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def configurations(self) -> list[Configuration]:
        """A configuration for each of the falloffs."""
        return list(map(self._configuration, self.falloffs))

    def _configuration(self, falloff: Falloff) -> Configuration:
        """The configuration with one falloff: exact values, and the error allowed by how w converges there."""
        mu = falloff.resolve(self.mesh.radius)
        rate: Rate = mu.form if mu.form in POLYNOMIALS else mu.tau
        exact = np.broadcast_to(np.asarray(self.exact(rate, mu.max_distance), np.float64), self.points.shape)
        other = exact if self.bracket is None else np.asarray(self.bracket(rate, mu.max_distance), np.float64)
        closed = mu.binary and self.missing == 0.0 and (exact == 0.0).all()
        target = BINARY_TARGET if mu.binary else EXPONENTIAL_TARGET
        fall = BINARY_RATE if mu.binary else EXPONENTIAL_RATE
        if (exact == 1.0).all():
            target, fall = 0.0, 0.0
        elif self.certain or closed:
            target = ZERO_VARIANCE_TARGET
            fall = 0.0
        options = {"normals": self.normals, **self.options}
        return Configuration(
            self.name,
            self.mesh,
            self.points,
            falloff,
            options,
            exact,
            target,
            rate=fall,
            truncation=self.missing * float(1.0 - mu(self.beyond)),
            tessellation=float(np.abs(exact - other).max()),
        )


@dataclass(frozen=True, eq=False)
class Configuration:
    """One line of the validation table, see `ValidationCase`.

    Attributes:
        options: of `ao.bake`, `normals` among them. exact: float64 (k,), w of the closed form at `points`.
        target: the error allowed to the estimator at 4,096 rays; 0 where w must be exactly 1.
        rate: with N rays it is (4096/N)^rate of that, but at most 1.
        truncation, tessellation: bounds on the stand-in's own error in w.
    """

    name: str
    mesh: Mesh
    points: Int64s
    falloff: Falloff
    options: Mapping[str, Any]
    exact: Float64s
    target: float
    rate: float
    truncation: float
    tessellation: float

    def allowed(self, samples: int = SAMPLES) -> float:
        """The largest |measured − exact| that passes with `samples` rays."""
        target: float = min(self.target * (SAMPLES / min(samples, MOST_SAMPLES)) ** self.rate, 1.0)
        return target + self.truncation + self.tessellation


def closed_form(form: Callable[..., float], *arguments: tuple[Any, ...]) -> ClosedForm:
    """w of some points by a function of `ao.closed_forms`, of each one's `arguments`, τ and, if finite, D."""

    def exact(tau: Rate, limit: float) -> list[float]:
        mu = (tau,) if limit == inf else (tau, limit)
        return [form(*row, *mu) for row in arguments]

    return exact


def posed(part: RawMesh, seed: int | None = None, normals: Float64s | None = None, source: str = "mesh") -> Mesh:
    """`part` as a Mesh, rotated and moved generically by `seed`; left where it is for None."""
    vertices, faces = part
    if seed is not None:
        rotation = generic_rotation(seed)
        shift = np.random.default_rng(seed).normal(size=3) * np.ptp(vertices, axis=0).max()
        vertices = rotation.apply(vertices) + shift
        normals = None if normals is None else rotation.apply(normals)
    return Mesh(vertices, faces, normals, source=source)
