"""The report of a bake, which `--report` writes: plain values, ready for JSON."""

import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from obscurance.raytrace import embree
from obscurance.raytrace.kernel.library import built_by
from obscurance.raytrace.types import AnyFloats

from .estimate.calibration import Calibration
from .points.receivers import Flag
from .result import Bake
from .texture.result import BakedTexture

SCHEMA_VERSION = 1
"""Of reports; grows when a name goes or changes its meaning, not when one is added."""
LISTED = 100
"""Vertices, or faces, of a flag that a report lists at most."""
_BINS = 40


def versions() -> dict[str, str]:
    """Versions of everything that can change a result."""
    packages = {"python": platform.python_version(), "embree": embree.version(), "kernels": built_by()}
    for package in ("obscurance", "embreex", "numpy", "scipy", "trimesh", "mapbox_earcut"):
        try:
            packages[package] = version(package)
        except PackageNotFoundError:
            packages[package] = "unknown"
    return packages


def report(
    bake: Bake | BakedTexture, options: dict[str, Any], seconds: dict[str, float], warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """The report of a bake as JSON-ready values.

    Args: options: every effective one of the command, `seed` among them. seconds: `load` and `write`; the bake adds
        `build` and `bake`. warnings: what limits the result, see `raytrace.mesh.warnings`.
    """
    # What texels have, or vertices.
    if isinstance(bake, BakedTexture):
        height, width = bake.w.shape
        has_value: Any = bake.covered
        size = {"width": width, "height": height, "texture": asdict(bake.facts)}
        of_vertices = {}
    else:
        has_value = ...
        size = {bake.at: len(bake.w)}
        between = bake.interpolation
        flagged = {str(flag.name).lower(): np.flatnonzero(bake.flags & flag)[:LISTED].tolist() for flag in Flag}
        of_vertices = {
            "flagged": bake.flagged,
            f"flagged_{bake.at}": {name: rows for name, rows in flagged.items() if rows},
            f"flagged_{bake.at}_at_most": LISTED,
            "interpolation": between and {"rmse": between.rmse, "at_least": between.at_least},
        }
    # What both have.
    profile = bake.profile
    return {
        "schema_version": SCHEMA_VERSION,
        **size,
        "rays": bake.rays,
        "rays_skipped": bake.rays_skipped,
        "seconds": seconds | bake.seconds,
        "rmse_estimate": bake.rmse,
        "error_calibration": calibration_facts(bake.calibration),
        **of_vertices,
        "warnings": list(warnings),
        "w": _summary(bake.w[has_value], 1.0),
        "error": _summary(bake.error[has_value]),
        "falloff": {
            "form": bake.mu.form,
            "tau": bake.mu.tau,
            "max_distance": "inf" if bake.mu.max_distance == float("inf") else bake.mu.max_distance,
            **({"knots": bake.mu.knots} if bake.mu.form == "table" else {}),
        },
        **({"profile": profile.lengths | {"rmse": bake.rmses[-len(profile.half_distances) :]}} if profile else {}),
        "seed": options["seed"],
        "options": options,
        "versions": versions(),
    }


def calibration_facts(calibration: Calibration | None) -> dict[str, Any] | None:
    """Estimated errors and measured ones, all together and in groups of about the same estimated error."""
    if calibration is None:
        return None
    return calibration.whole()._asdict() | {"groups": [group._asdict() for group in calibration.groups()]}


def _summary(values: AnyFloats, highest: float | None = None) -> dict[str, Any]:
    """Extremes, mean, quantiles and a histogram from 0 to `highest`, or to the largest value."""
    top = float(values.max(initial=0.0)) if highest is None else highest
    counts, _ = np.histogram(values, _BINS, (0.0, top or 1.0))
    shown = values if values.size else np.zeros(1)
    quantiles = {str(share): float(np.quantile(shown, share)) for share in (0.01, 0.1, 0.5, 0.9, 0.99)}
    return {
        "least": float(shown.min()),
        "mean": float(shown.mean()),
        "most": float(shown.max()),
        "quantiles": quantiles,
        "histogram": {"from": 0.0, "to": top or 1.0, "counts": counts.tolist()},
    }
