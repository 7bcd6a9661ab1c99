"""The processor: its name and the width of its vector instructions."""

import platform
from functools import cache
from pathlib import Path

from ..kernel.library import level

_LANES = {"x86-64-v4": (16, "AVX-512"), "x86-64-v3": (8, "AVX2"), "x86-64": (4, "SSE2"), "arm64": (4, "NEON")}


def processor() -> str:
    """Such as "AMD EPYC 9R14 (x86-64-v4), 16 lanes of float32 (AVX-512)"; the level in brackets is the kernels'."""
    count, instructions = lanes()
    return f"{model()} ({level()}), {count} lanes of float32 ({instructions})"


def lanes() -> tuple[int, str]:
    """How many float32 numbers a vector instruction of the kernels takes, and what such instructions are called."""
    return _LANES[level()]


@cache
def model() -> str:
    """The name that the system gives the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or platform.machine()
