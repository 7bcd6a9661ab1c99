"""The JSON report of a bake, which `--report` writes."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from raytrace.embree import library as embree

from .gather.receivers import Flag
from .result import Bake


def versions() -> dict[str, str]:
    """Versions of everything that can change a result."""
    found = {"python": platform.python_version(), "embree": embree.version()}
    for package in ("obscurance", "embreex", "numba", "numpy", "scipy", "trimesh", "mapbox_earcut"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found


def report(
    bake: Bake, options: dict[str, Any], seconds: dict[str, float], warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """The report of a bake as JSON-ready values.

    Args:
        options: every effective option of the command, `seed` among them.
        seconds: `load` and `write`; the bake adds `build` and `bake`.
        warnings: what limits the result, see `raytrace.mesh.precision`.
    """
    return {
        "vertices": len(bake.w),
        "rays": bake.rays,
        "rays_skipped": bake.rays_skipped,
        "seconds": seconds | bake.seconds,
        "rmse_estimate": bake.rmse,
        "flagged": bake.flagged,
        "flagged_vertices": {
            str(flag.name).lower(): np.flatnonzero(bake.flags & flag).tolist()
            for flag in Flag
            if (bake.flags & flag).any()
        },
        "warnings": list(warnings),
        "falloff": {
            "form": "binary" if bake.mu.tau is None else "exponential",
            "tau": bake.mu.tau,
            "max_distance": "inf" if bake.mu.max_distance == float("inf") else bake.mu.max_distance,
        },
        "seed": options["seed"],
        "options": options,
        "versions": versions(),
    }
