"""The validation table: closed forms against the w of `ao.bake`, as aligned text."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import isinf

import numpy as np

from obscurance.ao import Bake, Exponential, Falloff
from obscurance.ao import bake as _bake
from obscurance.raytrace.types import Float64s

from .configurations import SAMPLES, Configuration
from .curved import curved_cases
from .flat import flat_cases

Baker = Callable[..., Bake]


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Collection[str]) -> list[str]:
    """Lines of text, the head first; every cell to the left but in the columns headed by `numbers`."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if name in numbers else cell.ljust(width)
            for cell, width, name in zip(row, widths, head, strict=True)
        ).rstrip()
        for row in (head, *rows)
    ]


@dataclass(frozen=True)
class Result:
    """One line of the table: the vertex of a configuration with the largest error.

    Attributes: allowed: the largest |error| that passes: the estimator's target and the bound on the stand-in's own.
    """

    line: Configuration
    measured: float
    exact: float
    allowed: float

    @property
    def error(self) -> float:
        """NaN where the measured w is NaN."""
        return self.measured - self.exact

    @property
    def ok(self) -> bool:
        """Whether the error is one that is allowed."""
        return abs(self.error) <= self.allowed


@lru_cache(maxsize=1)
def configurations() -> tuple[Configuration, ...]:
    return tuple(line for case in (*flat_cases(), *curved_cases()) for line in case.configurations())


def measure(
    configuration: Configuration, bake: Baker = _bake, samples: int = SAMPLES, seed: int = 0, threads: int | None = None
) -> Float64s:
    """The w (k,) of a bake at the configuration's points."""
    mesh = configuration.mesh
    falloff = configuration.falloff
    only = None if mesh.normals is None else ~np.isnan(mesh.normals).any(axis=1)  # the others need no bake
    baked = bake(mesh, falloff, samples=samples, seed=seed, threads=threads, only=only, **configuration.options)
    return baked.w[configuration.points]


def compare(configuration: Configuration, measured: Float64s, samples: int = SAMPLES) -> Result:
    """The result of a configuration from w (k,) measured at its points with `samples` rays."""
    exact = configuration.exact
    worst = int(np.argmax(np.abs(measured - exact)))  # a NaN counts as the largest
    return Result(configuration, float(measured[worst]), float(exact[worst]), configuration.allowed(samples))


def run_validation(
    bake: Baker = _bake,
    samples: int = SAMPLES,
    seed: int = 0,
    threads: int | None = None,
    lines: Sequence[Configuration] | None = None,
) -> list[Result]:
    """Bake every configuration and compare it with its closed form.

    Args: bake: called as `ao.bake` is. lines: the configurations; all of them for None.
    """
    chosen = configurations() if lines is None else lines
    return [compare(line, measure(line, bake, samples, seed, threads), samples) for line in chosen]


def described(falloff: Falloff) -> str:
    """A falloff in a few words: "binary", "τ = 2, D = 1.5"."""
    kind = f"τ = {falloff.tau:g}" if isinstance(falloff, Exponential) else type(falloff).__name__.lower()
    limit = float(falloff.max_distance)
    return kind if isinf(limit) else f"{kind}, D = {limit:.3g}"


def validation_table(results: Sequence[Result]) -> str:
    """The results as lines of text, and a count; the error allowed includes a stand-in's own, which has its column."""
    head = ("closed form", "falloff", "measured", "exact", "error", "allowed", "stand-in", "")
    cells = [
        (r.line.name, described(r.line.falloff), f"{r.measured:.6f}", f"{r.exact:.6f}", f"{r.error:+.6f}",
         f"{r.allowed:.6f}", f"{r.line.truncation + r.line.tessellation:.6f}", "ok" if r.ok else "FAILED")
        for r in results
    ]  # fmt: skip
    lines = text_table(head, cells, head[2:7])
    failed = sum(not r.ok for r in results)
    count = f"{failed} of {len(results)} failed" if failed else f"all {len(results)} within what is allowed"
    return "\n".join([*lines, count])
