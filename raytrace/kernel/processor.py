"""The processor: the level of its instructions, which kernels are built for, their width, and its name."""

import platform
from functools import cache
from importlib import import_module
from pathlib import Path

_X86 = {
    "x86-64-v4": ("AVX512F", "AVX512BW", "AVX512CD", "AVX512DQ", "AVX512VL"),
    "x86-64-v3": ("AVX2", "FMA3"),
    "x86-64": (),
}
"""Levels, the best one first, and the instructions that tell them by NumPy's names."""
ARM = "arm64"
_LANES = {"x86-64-v4": (16, "AVX-512"), "x86-64-v3": (8, "AVX2"), "x86-64": (4, "SSE2"), "arm64": (4, "NEON")}


@cache
def level() -> str:
    """The best level of processors that this machine has, such as "x86-64-v3"."""
    if platform.machine().lower() in ("arm64", "aarch64"):
        return ARM
    features = cpu_features()
    return next(name for name, needed in _X86.items() if features.issuperset(needed))


@cache
def cpu_features() -> frozenset[str]:
    """The instructions that this machine's processor has, by NumPy's names."""
    numpys = import_module("numpy._core._multiarray_umath")
    return frozenset(name for name, has in numpys.__cpu_features__.items() if has)


def levels() -> tuple[str, ...]:
    """The levels that a package for this kind of machine is built for."""
    return (ARM,) if level() == ARM else tuple(dict.fromkeys(("x86-64-v3", "x86-64-v4", level())))


def machine() -> str:
    """The system, the processor's kind and its level, such as "Linux on x86_64, x86-64-v4"."""
    named = f"{platform.system()} on {platform.machine()}, {level()}"
    return f"{named}, below x86-64-v3 (AVX2, FMA)" if level() == "x86-64" else named


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
