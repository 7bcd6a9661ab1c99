"""The methods that are compared, as data: our own ways to bake, and the peers'."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

OURS = "obscurance"
SAMPLES = (4, 16, 64, 256, 1024, 4096)


@dataclass(frozen=True)
class Method:
    """One curve of time against error.

    Attributes:
        program: `OURS`, or the peer that runs it.
        setting: the argument that is climbed, `ladder` its values from fast to good.
        options: further arguments of `ao.bake`, or of the peer's `trace`.
        falloffs: forms it can bake.
        seconds: how long it may work on one mesh and falloff; it begins no rung that would take it beyond, but two.
        most_vertices: larger meshes are left out.
    """

    name: str
    program: str
    setting: str = "samples"
    ladder: tuple[float, ...] = SAMPLES
    options: Mapping[str, Any] = field(default_factory=dict)
    falloffs: tuple[str, ...] = ("binary", "exponential")
    seconds: float = 30.0
    most_vertices: int = 10**9


METHODS = (
    Method("to a tolerance", OURS, "tolerance", (0.08, 0.04, 0.02, 0.01, 0.005, 0.0025)),
    Method("samples", OURS),
    Method("brute force", OURS, options={"denoise": False}),
    Method("Mitsuba multijitter", "mitsuba", options={"sampler": "multijitter"}),
    Method("Mitsuba ldsampler", "mitsuba", options={"sampler": "ldsampler"}),
    Method("Mitsuba independent", "mitsuba", options={"sampler": "independent"}, seconds=8.0),
    Method("embreex + NumPy", "embreex", seconds=8.0),
    Method("Open3D + NumPy", "open3d", seconds=8.0),
    Method("Blender", "blender", ladder=SAMPLES[1:], falloffs=("binary",), seconds=20.0, most_vertices=60_000),
)
"""Ours first: speed-ups are of it, and of every other method whose program is `OURS`, over the rest."""

DENSE = (
    Method("to a tolerance", OURS, "tolerance", (0.04, 0.02, 0.01, 0.005), seconds=90.0),
    Method("samples", OURS, ladder=(16, 64, 256), seconds=90.0),
    Method("Mitsuba multijitter", "mitsuba", ladder=(64, 256), options={"sampler": "multijitter"}, seconds=90.0),
)
"""For meshes of which whole ladders would take an hour: the rungs about the errors wanted."""

_FEW = (16, 64, 256)
PROCESSES = (
    Method("to a tolerance", OURS, "tolerance", (0.02, 0.01, 0.004)),
    Method("samples", OURS, ladder=_FEW),
    Method("Mitsuba multijitter", "mitsuba", ladder=_FEW, options={"sampler": "multijitter"}),
    Method("Open3D + NumPy", "open3d", ladder=_FEW),
    Method("Blender", "blender", ladder=_FEW, falloffs=("binary",), seconds=20.0, most_vertices=60_000),
)
"""For whole processes."""
