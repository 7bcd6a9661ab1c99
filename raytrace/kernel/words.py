"""Arguments and results of machine code: a word for each number, the address of its object for each array."""

from collections.abc import Iterable, Iterator
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.np.arrayobj import make_array, populate_array

from .jit import types
from .lanes import RecordView

_WORD = ir.IntType(64)
_HEAD = object.__basicsize__ // 8  # words before an array's own: data, number of axes, lengths, strides
_DATA = _HEAD
_SHAPE = _HEAD + 2
_STRIDES = _HEAD + 3
_context = cpu_target.target_context


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
