"""Kernels to object files, by Numba: imported where kernels are compiled and never otherwise.

Numba's own dispatchers make for each function, inlined or not, machine code and two wrappers with Python's types. Here
a kernel and all that it calls become one object file with one entry, which takes the addresses of NumPy's arrays. It is
position-independent, for a level of processors rather than for this one, and calls C functions by pointers. It takes
and gives a word for each number, and takes the address of its Python object for each array.
"""

import ctypes
import gc
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import count
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import rtsys
from numba.np.arrayobj import make_array, populate_array

from . import lanes as lanes  # Numba knows the type and its operators from then on
from .jit import types
from .lanes import RecordView
from .library import ABOUT, BUILT, POINTER, SOURCES, about, identities_of_sources, pointers
from .processor import ARM, level, levels
from .signature import Signature

_WORD = ir.IntType(64)
_BYTE = ir.IntType(8)
_POINTER = _BYTE.as_pointer()
_INFO = 48  # bytes before Numba's arrays: count of references, destructor, its argument, data, size, allocator
_OF_NUMBA = ("NRT_", "numba_", "Py", "_Py")  # functions that a process without Numba has not
_context = cpu_target.target_context
_kept: list[CPUDispatcher] = []  # Numba's types only refer to them weakly
_HEAD = object.__basicsize__ // 8  # words before an array's own: data, number of axes, lengths, strides
_DATA = _HEAD
_SHAPE = _HEAD + 2
_STRIDES = _HEAD + 3


class _Dispatcher(CPUDispatcher):
    """A function that other functions are compiled with: typed and lowered, but not made into machine code."""

    def __init__(self, function: Callable[..., Any], inlined: bool) -> None:
        options = {"nopython": True, "nogil": True, "error_model": "numpy", "forceinline": inlined}
        options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "boundscheck": None}
        super().__init__(function, locals={}, targetoptions=options)
        self._compiler._customize_flags = _lowered_only

    def add_overload(self, compiled: Any) -> None:
        """Take a compiled signature, so that callers find it; Numba would make machine code of it here."""
        key = object()
        _context.insert_user_function(key, compiled.fndesc, [compiled.library])
        self.overloads[tuple(compiled.signature.args)] = compiled._replace(entry_point=key)


class _Library(JITCodeLibrary):
    """The code of one function: those that it calls are linked to a whole kernel and optimised there, once."""

    def add_linking_library(self, library: Any) -> None:
        """Note a library that this one calls; Numba would link a copy of it here."""
        self._linking_libraries.append(library)


def _lowered_only(flags: Any) -> Any:
    flags.no_compile = True
    return flags


def type_of(function: Callable[..., Any], inlined: bool) -> Any:
    """Numba's type of a kernel or helper, as which other kernels know it."""
    _kept.append(_Dispatcher(function, inlined))
    return types.Dispatcher(_kept[-1])


def intrinsic(signature: Callable[..., Any], emit: Callable[..., Any]) -> Any:
    """Numba's type of a function that writes LLVM's code, as `raytrace.kernel.jit.intrinsic` has it."""

    def define(_typing: Any, *kinds: Any) -> Any:
        """The signature for arguments of these types, None for wrong ones, and the code, as Numba asks for them."""
        typed = signature(*kinds)
        return typed and (typed, lambda context, builder, kinds, values: emit(context, builder, kinds, *values))

    define.__signature__ = inspect.Signature([*inspect.signature(emit).parameters.values()][2:])  # type: ignore[attr-defined]
    compiled = numba.extending.intrinsic(define)
    cpu_target.typing_context.refresh()
    return cpu_target.typing_context.resolve_value_type(compiled)


@contextmanager
def _compiling() -> Iterator[None]:
    """Within this block Numba makes no machine code but that of the kernel asked for, on this thread alone.

    The garbage collector is off, which would take a sixth of the time and find little.
    """
    nowhere = ctypes.c_void_p()  # Numba writes there what wrappers would need

    class Idle:
        add_module = finalize_object = staticmethod(lambda *_: None)
        is_symbol_defined = staticmethod(lambda _: False)
        get_global_value_address = staticmethod(lambda _: ctypes.addressof(nowhere))

    with global_compiler_lock:
        rtsys.initialize(_context)
        codegen = _context.codegen()
        previous = codegen._engine, codegen._library_class, codegen._tm
        codegen._engine, codegen._library_class, codegen._tm = Idle(), _Library, machine_of(levels()[0])
        collecting = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            codegen._engine, codegen._library_class, codegen._tm = previous
            if collecting:
                gc.enable()


@cache
def machine_of(level: str) -> llvm.TargetMachine:
    """LLVM's machine for processors of a level."""
    of_arm = "apple-m1" if sys.platform == "darwin" else "generic"
    target = llvm.Target.from_triple(llvm.get_process_triple())
    machine = target.create_target_machine(
        cpu=of_arm if level == ARM else level, opt=numba.config.OPT, reloc="pic", codemodel="default"
    )
    return machine


def object_files(
    signature: Signature,
    function: Callable[..., Any],
    arguments: tuple[Any, ...],
    levels: Iterable[str],
    identity: str = "",
) -> list[bytes]:
    """A kernel for arguments of certain types as object files, one for each level.

    Its function, of the signature's symbol, takes the address of one word for each number and array of the arguments,
    tuples being taken apart: a number's value, with double precision if it is no whole number, or the address of the
    array's Python object. To a second address it writes the results, a word each. It returns 0, or 1 if it ran out of
    memory. Its text holds the formats of the results, as `struct` has them, a tuple's in brackets.

    Arguments outlive the call, so that their arrays own nothing in it: no member or slice of them counts references,
    which would be atomic.

    A `Kernel.callback` takes one address, its first argument, and finds the words from there. Args: identity: for the
        text, by which `raytrace.kernel.library` knows what the code is made of.
    """
    symbol, path = signature.symbol, signature.path
    with _compiling():
        argument_types = tuple(lanes.view_type(type_of_value(argument)) for argument in arguments)
        dispatcher = _Dispatcher(function, True)
        dispatcher.compile(argument_types)
        compiled = dispatcher.overloads[argument_types]
        # The entry: the words of the arguments, found by `path` from the first address.
        module = _context.create_module(symbol)
        entry = ir.Function(module, ir.FunctionType(ir.IntType(32), [_POINTER, _POINTER]), symbol)
        builder = ir.IRBuilder(entry.append_basic_block())
        words = builder.bitcast(entry.args[0], _WORD.as_pointer())
        results = builder.bitcast(entry.args[1], _WORD.as_pointer())
        for element in path:
            pointer = builder.load(cgutils.gep_inbounds(builder, words, element))
            words = builder.inttoptr(pointer, _WORD.as_pointer())
        word_numbers = count()
        values = [load_argument(builder, words, word_numbers, kind) for kind in argument_types]
        if path:
            values[0] = builder.ptrtoint(entry.args[0], _WORD)
        status, value = _context.call_internal_no_propagate(builder, compiled.fndesc, compiled.signature, values)
        with builder.if_then(status.is_error):
            builder.ret(ir.IntType(32)(1))
        formats = store_results(builder, compiled.signature.return_type, value, results, count())
        builder.ret(ir.IntType(32)(0))
        _text(module, symbol + ABOUT, f"{formats}\n{identity}")
        return _emitted(compiled.library, module, symbol, levels)


def shared_object_file(names: Iterable[str], level: str) -> bytes:
    """What a library has once: pointers to the C functions `names`, by what it was built and of which sources."""
    module = ir.Module("shared")
    module.triple = llvm.get_process_triple()
    for name in names:
        pointer = ir.GlobalVariable(module, _POINTER, POINTER + name)
        pointer.initializer = _POINTER(None)
    _text(module, BUILT, f"Numba {numba.__version__}, LLVM {'.'.join(map(str, llvm.llvm_version_info))}")
    _text(module, SOURCES, identities_of_sources())
    code: bytes = machine_of(level).emit_object(llvm.parse_assembly(str(module)))
    return code


def _text(module: ir.Module, name: str, text: str) -> None:
    """Add a global constant to an LLVM module: a text that ends with a zero byte."""
    content = bytearray(text.encode() + b"\0")
    constant = ir.GlobalVariable(module, ir.ArrayType(_BYTE, len(content)), name)
    constant.initializer = ir.Constant(constant.value_type, content)
    constant.global_constant = True


def _emitted(library: Any, module: Any, symbol: str, levels: Iterable[str]) -> list[bytes]:
    """The bitcode of `symbol` in `module`, with all that it calls in `library`, as an object file for each level."""
    library.add_ir_module(module)
    library.add_ir_module(_memory())
    whole, libraries = library._final_module, [library]
    for other in libraries:
        libraries += [linked for linked in dict.fromkeys(other._linking_libraries) if linked not in libraries]
    for linked in libraries[1:]:
        whole.link_in(linked._final_module, preserve=True)
    for defined in (*whole.functions, *whole.global_variables):
        if not defined.is_declaration and defined.name not in (symbol, symbol + ABOUT):
            defined.linkage = "internal"
    whole.verify()
    bitcode = whole.as_bitcode()
    return [_optimized(library, bitcode, symbol, level) for level in levels]


def _optimized(library: Any, bitcode: bytes, symbol: str, level: str) -> bytes:
    """The object file of a kernel for a level. Raises: TypeError: it calls functions of Numba's runtime."""
    machine = _context.codegen()._tm = machine_of(level)
    library._final_module = llvm.parse_bitcode(bitcode)
    library._optimize_final_module()
    final = library._final_module
    missing = [
        function.name for function in final.functions if function.is_declaration and function.name.startswith(_OF_NUMBA)
    ]
    if missing:
        raise TypeError(f"{symbol}: expected no lists, texts or NumPy's sort, which need Numba's {missing}")
    code: bytes = machine.emit_object(final)
    return code


def _memory() -> Any:
    """Stand-ins for Numba's runtime, which warm processes do not load: memory from `malloc`."""
    module = _context.create_module("memory")
    nothing = ir.VoidType()
    malloc = ir.Function(module, ir.FunctionType(_POINTER, [_WORD]), "malloc")
    free = ir.Function(module, ir.FunctionType(nothing, [_POINTER]), "free")
    sizes = [_WORD, ir.IntType(32)]  # bytes, alignment
    allocate = ir.Function(module, ir.FunctionType(_POINTER, sizes), "NRT_MemInfo_alloc_aligned")
    release = ir.Function(module, ir.FunctionType(nothing, [_POINTER]), "NRT_MemInfo_call_dtor")

    builder = ir.IRBuilder(allocate.append_basic_block())
    size = allocate.args[0]
    align = builder.zext(allocate.args[1], _WORD)
    spare = builder.add(align, _WORD(_INFO))
    info = builder.call(malloc, [builder.add(size, spare)])
    with builder.if_then(cgutils.is_not_null(builder, info)):
        end = builder.add(builder.ptrtoint(info, _WORD), spare)
        words = builder.bitcast(info, _WORD.as_pointer())
        for place, word in ((0, _WORD(1)), (1, _WORD(0)), (3, builder.sub(end, builder.urem(end, align))), (4, size)):
            builder.store(word, cgutils.gep_inbounds(builder, words, place))
    builder.ret(info)

    builder = ir.IRBuilder(release.append_basic_block())
    builder.call(free, release.args)
    builder.ret_void()
    return module


def type_of_value(value: Any) -> Any:
    """Numba's type of an argument; that of a read-only array is as if it were writable."""
    if isinstance(value, tuple):
        return types.BaseTuple.from_types(tuple(map(type_of_value, value)), type(value))
    kind = numba.typeof(value)
    return kind.copy(readonly=False) if isinstance(kind, types.Array) else kind


def load_argument(builder: Any, words: Any, word_numbers: Iterator[int], kind: Any) -> Any:
    """LLVM's code that makes a value of a Numba type of the next words."""
    if isinstance(kind, RecordView):
        record = load_argument(builder, words, word_numbers, kind.record)
        return builder.bitcast(cgutils.alloca_once_value(builder, record), cgutils.voidptr_t)
    if isinstance(kind, types.BaseTuple):
        members = [load_argument(builder, words, word_numbers, member) for member in kind.types]
        return _context.make_tuple(builder, kind, members)
    if kind == types.none:
        return _context.get_dummy_value()
    word = builder.load(cgutils.gep_inbounds(builder, words, next(word_numbers)))
    if isinstance(kind, types.Array):
        return _array(builder, word, kind)
    if isinstance(kind, types.Float):
        number = builder.bitcast(word, ir.DoubleType())
        return builder.fptrunc(number, ir.FloatType()) if kind.bitwidth < 64 else number
    if isinstance(kind, types.Boolean):
        return builder.icmp_unsigned("!=", word, _WORD(0))
    return builder.trunc(word, ir.IntType(kind.bitwidth)) if kind.bitwidth < 64 else word


def _array(builder: Any, word: Any, kind: Any) -> Any:
    """The array whose Python object is at an address; it is kept by who calls."""

    def words(address: Any, places: Iterable[int]) -> list[Any]:
        """Words of the Python object at these places."""
        pointer = builder.inttoptr(address, _WORD.as_pointer())
        return [builder.load(cgutils.gep_inbounds(builder, pointer, element)) for element in places]

    data, lengths, steps = words(word, (_DATA, _SHAPE, _STRIDES))
    shape = words(lengths, range(kind.ndim))
    strides = words(steps, range(kind.ndim))
    array = make_array(kind)(_context, builder)
    size = _context.get_abi_sizeof(_context.get_data_type(kind.dtype))
    populate_array(array, builder.inttoptr(data, array.data.type), shape, strides, _WORD(size), None)
    return array._getvalue()


def store_results(builder: Any, kind: Any, value: Any, results: Any, word_numbers: Iterator[int]) -> str:
    """LLVM's code that writes a value to where results are wanted, a word each number; returns their formats."""
    if kind == types.none:
        return ""
    if isinstance(kind, types.BaseTuple):
        members = [builder.extract_value(value, member) for member in range(len(kind))]
        typed = zip(kind, members, strict=True)
        formats = [store_results(builder, part, member, results, word_numbers) for part, member in typed]
        return f"({''.join(formats)})"
    if isinstance(kind, types.Float):
        word, letter = builder.bitcast(builder.fpext(value, ir.DoubleType()), _WORD), "d"
    elif isinstance(kind, types.Integer | types.Boolean):
        signed = isinstance(kind, types.Integer) and kind.signed
        word, letter = (builder.sext(value, _WORD), "q") if signed else (builder.zext(value, _WORD), "Q")
        letter = "?7x" if isinstance(kind, types.Boolean) else letter
    else:
        raise TypeError(f"result of a kernel: expected numbers and tuples of them, got {kind}")
    builder.store(word, cgutils.gep_inbounds(builder, results, next(word_numbers)))
    return letter


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
