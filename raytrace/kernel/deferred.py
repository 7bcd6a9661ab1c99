"""Modules that are needed only while kernels are compiled, and imported when one of their names is first used.

Importing Numba takes longer than most bakes, whose kernels are machine code that an earlier run has left.
"""

from importlib import import_module
from typing import Any


class Deferred:
    """Stands for a module of this name."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self._name), name)


ir, types, cgutils = Deferred("llvmlite.ir"), Deferred("numba.core.types"), Deferred("numba.core.cgutils")
arrayobj = Deferred("numba.np.arrayobj")
lanes = Deferred("raytrace.kernel.lanes")
compiler = Deferred("raytrace.kernel.compiler")
