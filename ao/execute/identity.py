"""The identity of a machine, which decides the bits of traced rows beside the input: code, libraries, processor."""

import hashlib
import platform
from collections.abc import Mapping
from functools import cache

import llvmlite.binding
import numpy as np

from raytrace.embree import library as embree
from raytrace.kernel.cache import numba_settings, source_hash


@cache
def machine() -> dict[str, str]:
    """Facts that must be equal for rows of the same bits, by name.

    The C library counts for its sines, and NumPy and Embree choose instructions by what the processor has.
    """
    features = llvmlite.binding.get_host_cpu_features().flatten()
    return {
        "code": source_hash(),
        "Embree": embree.version(),
        "NumPy": np.__version__,
        "llvmlite": llvmlite.__version__,
        "C library": " ".join(platform.libc_ver()) or platform.system(),
        "processor": llvmlite.binding.get_host_cpu_name(),
        "instructions": hashlib.sha256(features.encode()).hexdigest()[:8],
        "Numba's settings": numba_settings() or "none",
    }


def first_difference(expected: Mapping[str, str], got: Mapping[str, str]) -> tuple[str, str, str] | None:
    """The name and both values of the first entry that differs, or None."""
    for name in (*expected, *(name for name in got if name not in expected)):
        if expected.get(name) != got.get(name):
            return name, expected.get(name, "nothing"), got.get(name, "nothing")
    return None
