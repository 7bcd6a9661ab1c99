"""Kernels that no library has, as edited ones in a source tree: LLVM links them in the process that calls them."""

from collections.abc import Callable
from functools import cache
from typing import Any

import llvmlite.binding as llvm

from .compiler import machine_of, object_files
from .library import ABOUT, about, level, pointers
from .signature import Signature


@cache
def _engine() -> llvm.ExecutionEngine:
    """LLVM's just-in-time linker, for object files of this machine."""
    machine = machine_of(level())
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def linked_here(signature: Signature, function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, int]:
    """The formats of a kernel's results and the address of its code, which LLVM links in this process."""
    (code,) = object_files(signature, function, arguments, [level()])
    for name, address in pointers().items():
        llvm.add_symbol(name, address)
    _engine().add_object_file(llvm.ObjectFileRef.from_data(code))
    _engine().finalize_object()
    formats, _ = about(_engine().get_global_value_address(signature.symbol + ABOUT))
    return formats, _engine().get_function_address(signature.symbol)
