"""The processor that kernels are compiled for: its name and the width of its vector instructions."""

import platform
from pathlib import Path

import llvmlite.binding

_WIDTHS = {"avx512f": ("AVX-512", 16), "avx": ("AVX", 8), "sse2": ("SSE2", 4), "neon": ("NEON", 4)}


def processor() -> str:
    """Such as "AMD EPYC (znver5), 16 lanes of float32 (AVX-512)"; the name in brackets is LLVM's."""
    features = llvmlite.binding.get_host_cpu_features()
    found = (width for feature, width in _WIDTHS.items() if features.get(feature))
    instructions, lanes = next(found, ("no vector instructions", 1))
    return f"{_model()} ({llvmlite.binding.get_host_cpu_name()}), {lanes} lanes of float32 ({instructions})"


def _model() -> str:
    """The name that the system has for the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or platform.machine()
