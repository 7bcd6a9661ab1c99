"""Identity of code: of what a kernel's machine code is made of, and of the sources that decide the results of a bake.

A kernel's identity is that of its function and, in turn, of all that its function refers to: helpers, constants,
classes, functions that write LLVM's code. Docstrings, annotations, comments and places in a file change nothing, nor
does what the kernel does not refer to.
"""

import dis
import hashlib
from collections.abc import Callable, Iterable, Iterator
from functools import cache, cached_property
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

PACKAGES = ("raytrace", "ao")
ROOT = Path(__file__).resolve().parents[2]
_NO_RESULTS = ("raytrace/text.py", "raytrace/image/write.py", "ao/report.py")
"""Sources that neither w nor the colour of a pixel depends on, beginnings of their paths."""
_TAKES_CONSTANT = frozenset(dis.hasconst)
_ONE_BYTE = 255  # instructions have more for larger numbers
_NOP = f"{dis.opmap['NOP']:02x}00"
_OURS = tuple(f"obscurance.{package}." for package in PACKAGES)


class Called:
    """A function that kernels call; its Numba type is made when one of them is compiled."""

    def __init__(self, make_type: Callable[[], Any]) -> None:
        self.make_type: Any = make_type

    @cached_property
    def _numba_type_(self) -> Any:
        """Numba's way to ask any object for its type."""
        return self.make_type()


def result_sources() -> list[str]:
    """Paths below `ROOT` of the sources that w or the colour of a pixel may depend on, in order."""
    paths = [path.relative_to(ROOT).as_posix() for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    return [path for path in sorted(paths) if not path.startswith(_NO_RESULTS)]


def source_identity(text: str) -> str:
    """Hash of a source file's text as its code objects have it, without docstrings: 16 hex digits."""
    return digest([_code(compile(text, "", "exec", dont_inherit=True, optimize=2))])


def kernel_identity(function: Any) -> str:
    """Hash of a function and of all that it refers to, directly or not: 16 hex digits."""
    reached: dict[FunctionType, str] = {}
    waiting: list[FunctionType] = [function]
    while waiting:
        latest = waiting.pop()
        if latest not in reached:
            reached[latest], others = _parts(latest)
            waiting += others
    return digest(reached.values())


def digest(texts: Iterable[str]) -> str:
    """Hash of texts in order: 16 hex digits."""
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()[:16]


def _code(code: CodeType, docstring: str | None = None) -> str:
    """What a code object does, without its docstring and the numbers of its lines.

    A docstring moves the other constants, above all None, and may leave an instruction behind that does nothing.
    """
    first_constant = 0 if docstring is None else 1
    kept = [index for index, value in enumerate(code.co_consts) if index >= first_constant and value is not None]
    renumbered = {index: number for number, index in enumerate(kept)}
    instructions = bytearray(code.co_code)
    if len(code.co_consts) <= _ONE_BYTE:
        for index in range(0, len(instructions), 2):
            if instructions[index] in _TAKES_CONSTANT:
                instructions[index + 1] = renumbered.get(instructions[index + 1], _ONE_BYTE)
    text = [instruction for instruction in instructions.hex(" ", 2).split() if instruction != _NOP]
    constants = [_constant(code.co_consts[index]) for index in kept]
    return f"{text} {code.co_names} {code.co_varnames} {constants}"


def _constant(value: Any) -> str:
    """Text of a constant, which may be code itself; sets have no order of their own."""
    if isinstance(value, CodeType):
        return _code(value)
    return f"{sorted(map(repr, value))}" if isinstance(value, frozenset) else repr(value)


@cache
def _parts(function: FunctionType) -> tuple[str, tuple[FunctionType, ...]]:
    """A function as text, and the functions that it refers to."""
    texts = [_code(function.__code__, function.__doc__)]
    functions: list[FunctionType] = []
    for value in (function.__defaults__, function.__kwdefaults__, *_referred(function)):
        texts.append(_text(value, functions))
    return " ".join(texts), tuple(functions)


def _referred(function: FunctionType) -> Iterator[Any]:
    """Values that a function refers to: globals by the names in its code, and variables of the functions that
    enclose it."""
    names = {name: None for code in _nested(function.__code__) for name in code.co_names}
    for name in names:
        value = function.__globals__.get(name)
        yield value
        if isinstance(value, ModuleType) and value.__name__.startswith(_OURS):
            yield from (vars(value)[other] for other in names if other in vars(value))
    yield from (cell.cell_contents for cell in function.__closure__ or ())


def _nested(code: CodeType) -> Iterator[CodeType]:
    """A code object and those of functions defined in it, at any depth."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _nested(constant)


def _text(value: Any, functions: list[FunctionType]) -> str:
    """A value as text that is the same in every process; functions are appended to `functions` instead.

    Raises: TypeError: nothing is known of such values.
    """
    if isinstance(value, FunctionType):
        functions.append(value)
        return "function"
    if isinstance(value, Called):
        functions.append(value.make_type)
        return "called"
    if isinstance(value, tuple):
        return f"({' '.join(_text(member, functions) for member in value)})"
    if isinstance(value, ModuleType | BuiltinFunctionType):
        return value.__name__
    if isinstance(value, type):
        return f"{value.__qualname__} {getattr(value, '_fields', ())}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if value is None or isinstance(value, int | float | str | np.generic):
        return f"{type(value).__name__} {value!r}"
    raise TypeError(f"what a kernel refers to: expected constants, functions and modules, got {type(value)}")
