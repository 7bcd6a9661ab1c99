"""Machine code in memory: LLVM puts it there and links it to Embree's and C's functions, and nothing is compiled."""

from functools import cache

import llvmlite.binding as llvm


@cache
def _engine() -> llvm.ExecutionEngine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine()
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def load(name: str, code: bytes) -> int:
    """Address of the function `name` of an object file."""
    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    address: int = engine.get_function_address(name)
    return address
