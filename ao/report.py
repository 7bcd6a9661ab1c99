"""The JSON report of a bake, which `--report` writes."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from raytrace.embree import library as embree

from .gather.receivers import Flag
from .result import Bake
from .texture.result import BakedTexture


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
    bake: Bake | BakedTexture, options: dict[str, Any], seconds: dict[str, float], warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """The report of a bake as JSON-ready values.

    Args:
        options: every effective option of the command, `seed` among them.
        seconds: `load` and `write`; the bake adds `build` and `bake`.
        warnings: what limits the result, see `raytrace.mesh.precision`.
    """
    return {
        **(_of_texture(bake) if isinstance(bake, BakedTexture) else {"vertices": len(bake.w)}),
        "rays": bake.rays,
        "rays_skipped": bake.rays_skipped,
        "seconds": seconds | bake.seconds,
        "rmse_estimate": bake.rmse,
        **(_flags(bake) if isinstance(bake, Bake) else {}),
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


def _flags(bake: Bake) -> dict[str, Any]:
    rows = {str(flag.name).lower(): np.flatnonzero(bake.flags & flag).tolist() for flag in Flag}
    return {"flagged": bake.flagged, "flagged_vertices": {name: found for name, found in rows.items() if found}}


def _of_texture(bake: BakedTexture) -> dict[str, Any]:
    height, width = bake.w.shape
    return {"width": width, "height": height, "texture": asdict(bake.facts)}
