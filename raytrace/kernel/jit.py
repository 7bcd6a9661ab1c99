"""Compilation of hot loops: decorators for kernels, and for the helpers, C functions and intrinsics that these call.

A kernel is compiled by Numba when it is first called with arguments of new types, and its machine code kept on disk
(`raytrace.kernel.cache`). Later processes load that code and call it, without importing Numba, which takes longer than
most bakes.
"""

import ctypes
import struct
import threading
import time
from collections.abc import Callable
from functools import cache, cached_property
from hashlib import sha256
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

import llvmlite.binding as llvm
import numpy as np

from ..types import Int64s
from .cache import read_code, write_code
from .identity import Called, kernel_identity
from .notice import compiling, notices

F = TypeVar("F", bound=Callable[..., Any])
_C, _FORTRAN, _ALIGNED = 0x1, 0x2, 0x100  # NumPy's flags
_LAYOUT = _C | _FORTRAN | _ALIGNED
_WORDS = {"b": "q", "i": "q", "u": "Q", "f": "d"}
ndarray = np.ndarray
_SIGNED = 1 << 63
_BRACKETS = str.maketrans("", "", "()")
_ENTRY = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_char_p, ctypes.c_void_p)
_lock = threading.RLock()
loaded: list[str] = []
"""Names of the kernels that this process has loaded, in this order."""
compiled: list[str] = []
"""Kernels that this process has compiled."""
compiling_seconds: list[float] = []
"""How long each of these took."""


class _Deferred(ModuleType):
    """A module that is needed only while kernels are compiled, imported when one of its names is first used."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.__name__), name)


ir = _Deferred("llvmlite.ir")
types = _Deferred("numba.core.types")
cgutils = _Deferred("numba.core.cgutils")
arrayobj = _Deferred("numba.np.arrayobj")
lanes = _Deferred("raytrace.kernel.lanes")
compiler = _Deferred("raytrace.kernel.compiler")


class _Loaded(NamedTuple):
    """A kernel for arguments of certain types: how to pack them, to unpack its results and to nest them, its code."""

    arguments: struct.Struct
    results: struct.Struct
    nesting: str
    call: Any


class Kernel(Called):
    """A function that Numba compiles: machine code when called from Python, a part of the kernels that call it.

    Arguments are arrays, numbers, None, and tuples of such; results are numbers or a tuple of numbers. Code under
    `if argument is not None` is left out where it is None. Read-only arrays share the code of writable ones, so a
    kernel must write to none but its results.

    Raises: TypeError: other arguments or results. MemoryError: an array that it makes does not fit.
    """

    def __init__(self, function: Callable[..., Any], inlined: bool = False) -> None:
        super().__init__(lambda: compiler.type_of(function, inlined))
        self.function = function
        self._for_types: dict[tuple[Any, ...], _Loaded] = {}
        self._by_name: dict[str, _Loaded] = {}
        self.__doc__, self.__name__, self.__module__ = function.__doc__, function.__name__, function.__module__

    def __call__(self, *arguments: Any) -> Any:
        return self._run(arguments, *_flatten(arguments, [], []))

    def _run(self, arguments: tuple[Any, ...], kinds: list[Any], words: list[Any]) -> Any:
        key = tuple(kinds)
        code = self._for_types.get(key) or self._load(key, arguments)
        results = ctypes.create_string_buffer(code.results.size) if code.results.size else None
        if code.call(code.arguments.pack(*words), results):
            raise MemoryError(f"{self.__name__}: no memory for its arrays")
        return _nested(code.nesting, code.results.unpack(results)) if results else None

    def callback(self, path: tuple[int, ...], *arguments: Any) -> tuple[int, Int64s]:
        """Address of a C function that calls this with the address it is given and `arguments`, and their words.

        Args: path: places of pointers, counted in words, that lead from what it is given to the words.
        """
        kinds, words = _flatten((0, *arguments), [], [])
        code = self._load(tuple(kinds), (0, *arguments), path)
        packed = np.frombuffer(code.arguments.pack(*words), np.int64)
        return ctypes.cast(code.call, ctypes.c_void_p).value or 0, packed

    def _load(self, key: tuple[Any, ...], arguments: tuple[Any, ...], path: tuple[int, ...] = ()) -> _Loaded:
        types, formats = _types(key)
        name = f"{self.__module__}.{self.__name__}.{sha256(types.encode()).hexdigest()[:16]}"
        with _lock:
            if name not in self._by_name:
                stored = _code(name, self.function, lambda: compiler.kernel_code(name, self.function, arguments, path))
                results, _, code = stored.partition(b"\n")
                nesting = results.decode()
                self._by_name[name] = _Loaded(
                    struct.Struct(formats),
                    struct.Struct(nesting.translate(_BRACKETS)),
                    nesting.replace("7x", ""),
                    _ENTRY(_address(name, code)),
                )
            self._for_types[key] = self._by_name[name]
        return self._for_types[key]


def kernel(function: F) -> F:
    """Compile a hot loop on first call: no Python objects, no GIL, kept on disk."""
    return Kernel(function)  # type: ignore[return-value]


def bind(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """A kernel to be called many times with the same first `arguments`, which are looked through once."""
    kernel: Kernel = function  # type: ignore[assignment]
    kinds, words = _flatten(arguments, [], [])
    return lambda *others: kernel._run((*arguments, *others), *_flatten(others, kinds.copy(), words.copy()))


def inline(function: F) -> F:
    """Compile a helper that kernels call; it is compiled into each of them."""
    return Kernel(function, inlined=True)  # type: ignore[return-value]


class Late(Called):
    """A helper that `build` makes when a kernel that calls it is first loaded or compiled."""

    def __init__(self, build: Callable[[], Any]) -> None:
        self.build = build

    @cached_property
    def make_type(self) -> Any:
        return self.build().make_type


def external(name: str, count: int) -> Any:
    """The C function of this name, which kernels call with `count` addresses."""
    return Called(lambda: compiler.external(name, count))


def intrinsic(signature: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Let kernels call a function that writes LLVM's code: from Numba's context, LLVM's builder, Numba's `signature` of
    the types of the arguments (None for wrong types), and their values."""
    return lambda emit: Called(lambda: compiler.intrinsic(signature, emit))


def _code(name: str, function: Callable[..., Any], compile_: Callable[[], bytes]) -> bytes:
    """A function's code by this name, from the disk or compiled and kept there."""
    loaded.append(name)
    kept = f"{name}.{kernel_identity(function)}"
    code = read_code(kept)
    if code is None:
        with compiling(1):  # unless what calls has said so, with a better number
            notices[0](name)
            compiled.append(name)
            start = time.perf_counter()
            code = compile_()
            compiling_seconds.append(time.perf_counter() - start)
        write_code(kept, code)
    return code


@cache
def _engine() -> llvm.ExecutionEngine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine()
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def _address(name: str, code: bytes) -> int:
    """Of the function `name` of an object file, which LLVM links to Embree's and C's functions; nothing is compiled."""
    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    address: int = engine.get_function_address(name)
    return address


def _flatten(values: tuple[Any, ...], kinds: list[Any], words: list[Any]) -> tuple[list[Any], list[Any]]:
    """Append what Numba's types of the values depend on, and what `kernel_code` makes the values of."""
    for value in values:
        kind = type(value)
        if isinstance(value, ndarray):
            kinds += (value.dtype, value.ndim, value.flags.num & _LAYOUT)
            words.append(id(value))
        elif isinstance(value, tuple):
            kinds += (kind, len(value))
            _flatten(value, kinds, words)
        elif value is None:
            kinds.append(kind)
        else:
            kinds.append(np.uint64 if kind is int and value >= _SIGNED else kind)
            words.append(int(value) if kind is np.bool_ else value)
    return kinds, words


def _types(key: tuple[Any, ...]) -> tuple[str, str]:
    """Text that differs where Numba's types do, and the format of the words, of what `_flatten` found."""
    text = []
    formats = ""
    kinds = iter(key)
    for kind in kinds:
        if isinstance(kind, np.dtype):
            dimensions = next(kinds)
            flags = next(kinds)
            text.append(f"{kind!r} {dimensions} {flags & ~_FORTRAN if flags & _C else flags}")
            formats += "P"
        elif issubclass(kind, tuple):
            text.append(f"{kind} {next(kinds)} {getattr(kind, '_fields', '')}")
        elif kind is type(None):
            text.append("None")
        else:
            number = np.dtype(kind)
            if number.kind not in _WORDS:
                raise TypeError(f"argument of a kernel: expected arrays, numbers and tuples of them, got {kind}")
            text.append(number.str)
            formats += _WORDS[number.kind]
    return "; ".join(text), formats


def _nested(nesting: str, values: tuple[Any, ...]) -> Any:
    """The values as formats say that stand in brackets where tuples are."""
    left = iter(values)
    levels: list[list[Any]] = [[]]
    for letter in nesting:
        if letter == "(":
            levels.append([])
        else:
            value = tuple(levels.pop()) if letter == ")" else next(left)
            levels[-1].append(value)
    return levels[0][0]
