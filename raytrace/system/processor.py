"""The processor that kernels are compiled for: its name and the width of its vector instructions."""

import platform
from functools import cache
from pathlib import Path

import llvmlite.binding

_WIDTHS = {"avx512f": (16, "AVX-512"), "avx": (8, "AVX"), "sse2": (4, "SSE2"), "neon": (4, "NEON")}


def processor() -> str:
    """Such as "AMD EPYC (znver5), 16 lanes of float32 (AVX-512)"; the name in brackets is LLVM's."""
    count, instructions = lanes()
    return f"{_model()} ({llvmlite.binding.get_host_cpu_name()}), {count} lanes of float32 ({instructions})"


@cache
def lanes() -> tuple[int, str]:
    """How many float32 numbers a vector instruction takes, and what such instructions are called."""
    features = llvmlite.binding.get_host_cpu_features()
    return next((width for feature, width in _WIDTHS.items() if features.get(feature)), (1, "no vector instructions"))


def _model() -> str:
    """The name that the system has for the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or platform.machine()
