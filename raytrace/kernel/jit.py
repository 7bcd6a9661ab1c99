"""Hot loops as machine code: decorators for kernels, and for the helpers, C functions and intrinsics that these call.

A kernel comes from the library that was built with the package (`raytrace.kernel.library`), for the types of arguments
that its annotations name, and for no others (`raytrace.types`). What the library has not, as an edit in a
source tree, is compiled when it is first called, if Numba is there; so are kernels without annotations, for any types.
"""

import ctypes
import inspect
import struct
import threading
from collections.abc import Callable
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from ..errors import KernelError
from ..types import Int64s
from . import library
from .identity import Called
from .library import POINTER
from .signature import LAYOUT, SIGNED, Signature

P = ParamSpec("P")
R = TypeVar("R")
ndarray = np.ndarray
_BRACKETS = str.maketrans("", "", "()")
_ENTRY = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_char_p, ctypes.c_void_p)
_lock = threading.RLock()
loaded: list[str] = []
"""The kernels that this process has loaded, in this order."""
compiled: list[str] = []
"""Those of them that it has compiled."""
externals: list[str] = []
"""Names of the C functions that kernels call."""


class _Deferred(ModuleType):
    """A module that is needed only while kernels are compiled, imported when one of its names is first used."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.__name__), name)


ir = _Deferred("llvmlite.ir")
types = _Deferred("numba.core.types")
arrayobj = _Deferred("numba.np.arrayobj")
lanes = _Deferred("obscurance.raytrace.kernel.lanes")
compiler = _Deferred("obscurance.raytrace.kernel.compiler")


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
        KernelError: it is annotated, and not for arguments of these types.
    """

    def __init__(self, function: Callable[..., Any], inlined: bool = False, path: tuple[int, ...] = ()) -> None:
        super().__init__(lambda: compiler.type_of(function, inlined))
        self.function, self.path = function, path
        self._for_types: dict[tuple[Any, ...], _Loaded] = {}
        self._by_symbol: dict[str, _Loaded] = {}
        self._name = f"{function.__module__}.{function.__name__}"
        self.__doc__, self.__name__, self.__module__ = function.__doc__, function.__name__, function.__module__

    def __call__(self, *arguments: Any) -> Any:
        return self._run(arguments, *_flatten(arguments, [], []))

    def for_rows(self, *arguments: Any) -> Callable[[int, int], Any]:
        """A call f(start, stop, …) for any rows with the same `arguments`, which are looked through once."""
        kinds, words = _flatten(arguments, [int, int], [])
        return lambda start, stop: self._run((start, stop, *arguments), kinds, [start, stop, *words])

    def _run(self, arguments: tuple[Any, ...], kinds: list[Any], words: list[Any]) -> Any:
        """Call the machine code for these types.

        Args: kinds: the types, of `_flatten`. words: the values, a word each.
        """
        key = tuple(kinds)
        code = self._for_types.get(key) or self._load(key, arguments)
        results = ctypes.create_string_buffer(code.results.size) if code.results.size else None
        if code.call(code.arguments.pack(*words), results):
            raise MemoryError(f"{self.__name__}: no memory for its arrays")
        return _nested(code.nesting, code.results.unpack(results)) if results else None

    def callback(self, *arguments: Any) -> tuple[int, Int64s]:
        """Address of a C function that calls this with the address it is given and `arguments`, and their words."""
        kinds, words = _flatten((0, *arguments), [], [])
        code = self._load(tuple(kinds), (0, *arguments))
        packed = np.frombuffer(code.arguments.pack(*words), np.int64)
        return ctypes.cast(code.call, ctypes.c_void_p).value or 0, packed

    def signature(self, arguments: tuple[Any, ...]) -> Signature:
        """The signature of a call with these arguments."""
        return Signature.of(self._name, tuple(_flatten(arguments, [], [])[0]), self.path)

    def _load(self, key: tuple[Any, ...], arguments: tuple[Any, ...]) -> _Loaded:
        """The machine code for the types `key`, from the library or compiled.

        Raises: KernelError.
        """
        signature = Signature.of(self._name, key, self.path)
        with _lock:
            if signature.symbol not in self._by_symbol:
                formats, address = _code(signature, self.function, arguments)
                self._by_symbol[signature.symbol] = _Loaded(
                    struct.Struct(signature.words),
                    struct.Struct(formats.translate(_BRACKETS)),
                    formats.replace("7x", ""),
                    _ENTRY(address),
                )
            self._for_types[key] = self._by_symbol[signature.symbol]
        return self._for_types[key]


def _code(signature: Signature, function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, int]:
    """The formats of a kernel's results, and the address of its code. Raises: KernelError."""
    loaded.append(signature.line)
    formats_and_address = library.find(signature.symbol, function)
    if formats_and_address is None:
        _check_types(signature, function, arguments)
        if not find_spec("numba"):
            raise KernelError(library.what_is_missing(signature.line))
        import logging

        logging.getLogger("obscurance").info("compiling kernel %s", signature.line)
        compiled.append(signature.line)
        formats_and_address = compiler.linked_here(signature, function, arguments)
    return formats_and_address


def _check_types(signature: Signature, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Raises: KernelError: the annotations of a parameter, if there are any, do not name the type of its argument."""
    from ..types import examples

    given = inspect.signature(function).bind(*arguments).arguments
    for parameter, allowed in examples(function).items():
        got, *expected = (_type(value) for value in (given[parameter], *allowed))
        if got not in expected:
            kernel, _, _ = signature.line.partition(" ")
            raise KernelError(f"{kernel}: {parameter}: expected {' or '.join(expected)}, got {got}")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator: compile a hot loop to machine code without Python objects and without the GIL."""
    return Kernel(function)  # type: ignore[return-value]


def called_back(*path: int) -> Callable[[Callable[..., Any]], Kernel]:
    """Decorator: a kernel that C functions call, `Kernel.callback`; its first argument is the address they give it.

    Args: path: places of pointers, counted in words, that lead from that address to the words of the other arguments.
    """
    return lambda function: Kernel(function, path=path)


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: a helper that kernels call, compiled into each of them."""
    return Kernel(function, inlined=True)


class Late(Called):
    """A helper that `build` makes when a kernel that calls it is first loaded or compiled."""

    def __init__(self, build: Callable[[], Any]) -> None:
        self.build = build

    @cached_property
    def make_type(self) -> Any:
        return self.build().make_type


def intrinsic(signature: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Let kernels call a function that writes LLVM's code: from Numba's context, LLVM's builder, Numba's `signature` of
    the types of the arguments (None for wrong types), and their values."""
    return lambda emit: Called(lambda: compiler.intrinsic(signature, emit))


def external(name: str) -> Any:
    """The C function of this name, which kernels call with four addresses; `library.provide` says where it is."""

    @intrinsic(lambda *_: types.void(*(types.uintp,) * 4))
    def call(context, builder, signature, first, second, third, fourth):
        """LLVM's code of a call of the function that a global pointer of that name points to."""
        kind = ir.FunctionType(ir.VoidType(), (ir.IntType(64),) * 4)
        module = builder.module
        pointer = module.globals.get(POINTER + name) or ir.GlobalVariable(module, kind.as_pointer(), POINTER + name)
        builder.call(builder.load(pointer), (first, second, third, fourth))
        return context.get_dummy_value()

    externals.append(name)
    return call


def _flatten(values: tuple[Any, ...], kinds: list[Any], words: list[Any]) -> tuple[list[Any], list[Any]]:
    """Append to `kinds` what the types of the values depend on, and to `words` what kernels get of the values."""
    for value in values:
        kind = type(value)
        if isinstance(value, ndarray):
            kinds += (value.dtype, value.ndim, value.flags.num & LAYOUT)
            words.append(id(value))
        elif isinstance(value, tuple):
            kinds += (kind, len(value))
            _flatten(value, kinds, words)
        elif value is None:
            kinds.append(kind)
        else:
            kinds.append(np.uint64 if kind is int and value >= SIGNED else kind)
            words.append(int(value) if kind is np.bool_ else value)
    return kinds, words


def _type(value: Any) -> str:
    """The text of a value's type in a signature."""
    return Signature.of("", tuple(_flatten((value,), [], [])[0]), ()).line.lstrip()


def _nested(nesting: str, values: tuple[Any, ...]) -> Any:
    """The values in tuples as the brackets of formats say."""
    left = iter(values)
    levels: list[list[Any]] = [[]]
    for letter in nesting:
        if letter == "(":
            levels.append([])
        else:
            value = tuple(levels.pop()) if letter == ")" else next(left)
            levels[-1].append(value)
    return levels[0][0]
