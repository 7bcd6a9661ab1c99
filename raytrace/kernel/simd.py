"""Sixteen numbers at once: a vector type for kernels, which the compiler keeps in SIMD registers.

Lanes of float32, float64, int32 or booleans combine with each other and with scalars by the usual operators, `min`,
`max`, `abs`, `sqrt` and `exp`; a comparison makes booleans, and `select` chooses by them. A helper written with these,
without branches on its values, serves scalars and lanes alike: `raytrace.kernel.vector` is made of such. The type
itself is in `raytrace.kernel.lanes`.
"""

from collections.abc import Callable
from typing import Any

from .deferred import arrayobj, ir, lanes, types
from .jit import intrinsic

WIDE = 16
_FOUR = 4


@intrinsic
def select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    """a where the condition holds, else b, both of them evaluated. Lanes may be mixed with scalars; two scalars
    make lanes of float32 or int32."""
    kind = lanes.common(a, b) or typing.unify_types(a, b)
    if kind is None:
        return None
    if isinstance(condition, lanes.Lanes) and not isinstance(kind, lanes.Lanes):
        kind = lanes.SINGLE if isinstance(kind, types.Float) else lanes.WHOLE

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        chosen, *given = arguments
        if isinstance(kind, lanes.Lanes):
            x, y = (lanes.widened(context, builder, v, t, kind) for v, t in zip(given, signature.args[1:], strict=True))
        else:
            x, y = (context.cast(builder, v, t, kind) for v, t in zip(given, signature.args[1:], strict=True))
        return builder.select(chosen, x, y)

    return kind(condition, a, b), generate


def _convert(to: str, emit: Callable[[Any, Any, Any], Any]) -> Any:
    @intrinsic
    def convert(_typing: Any, a: Any) -> Any:
        kind = getattr(lanes, to)
        vector = lanes.llvm_type(kind)
        return kind(a), lambda context, builder, signature, arguments: emit(builder, arguments[0], vector)

    return convert


single = _convert("SINGLE", lambda b, x, to: b.fptrunc(x, to))
double = _convert(
    "DOUBLE", lambda b, x, to: b.sitofp(x, to) if isinstance(x.type.element, ir.IntType) else b.fpext(x, to)
)


@intrinsic
def multiply_add(_typing: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c of lanes of float32, scalars repeated; rounded once where the processor can (FMA)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pairs = zip(arguments, signature.args, strict=True)
        given = [lanes.widened(context, builder, x, kind, lanes.SINGLE) for x, kind in pairs]
        return lanes.each(builder, "llvm.fmuladd", given)

    return lanes.SINGLE(a, b, c), generate


@intrinsic
def reciprocal_root(_typing: Any, a: Any) -> Any:
    """1/√a of lanes of float32 above 0, to about 2⁻²⁰: by the processor's estimate and a step of Newton's method."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        one = lanes.widened(context, builder, ir.Constant(ir.FloatType(), 1.0), types.float32, lanes.SINGLE)
        return builder.fdiv(one, lanes.each(builder, "llvm.sqrt", arguments), flags=("arcp", "contract", "reassoc"))

    return lanes.SINGLE(a), generate


@intrinsic
def lane_numbers(_typing: Any) -> Any:
    return lanes.WHOLE(), lambda *_: ir.Constant(lanes.llvm_type(lanes.WHOLE), list(range(WIDE)))


def _bits(builder: Any, mask: Any) -> Any:
    return builder.bitcast(mask, ir.IntType(WIDE))


@intrinsic
def some(_typing: Any, mask: Any) -> Any:
    """Whether any lane of a mask is set."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.icmp_unsigned("!=", _bits(builder, arguments[0]), ir.IntType(WIDE)(0))

    return types.boolean(mask), generate


@intrinsic
def count(_typing: Any, mask: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.zext(builder.ctpop(_bits(builder, arguments[0])), ir.IntType(64))

    return types.int64(mask), generate


@intrinsic
def first(_typing: Any, mask: Any) -> Any:
    """The first lane that is set in a mask that is not empty, int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        found = builder.cttz(_bits(builder, arguments[0]), ir.IntType(1)(0))
        return builder.zext(found, ir.IntType(64))

    return types.int64(mask), generate


@intrinsic
def bits(_typing: Any, mask: Any) -> Any:
    """The lanes that are set, as the lowest bits of an int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.zext(_bits(builder, arguments[0]), ir.IntType(64))

    return types.int64(mask), generate


@intrinsic
def lowest_bit(_typing: Any, number: Any) -> Any:
    """The place of the lowest bit that is set in an int64 that is not 0, int64."""
    return types.int64(types.int64), lambda _, builder, __, arguments: builder.cttz(arguments[0], ir.IntType(1)(0))


@intrinsic
def pick(_typing: Any, a: Any, lane: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.extract_element(*arguments)

    return a.dtype(a, types.int64), generate


@intrinsic
def replace(_typing: Any, a: Any, lane: Any, value: Any) -> Any:
    """`a` with another value in one lane."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector, at, given = arguments
        return builder.insert_element(vector, context.cast(builder, given, value, a.dtype), at)

    return a(a, types.int64, value), generate


def _reduced(name: str) -> Any:
    @intrinsic
    def reduce(_typing: Any, a: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            kind = ir.FunctionType(lanes.ELEMENT[a.dtype], [lanes.llvm_type(a)])
            function = builder.module.declare_intrinsic(f"llvm.vector.reduce.{name}.v{WIDE}f32", (), kind)
            return builder.call(function, arguments)

        return a.dtype(a), generate

    return reduce


lowest, highest = _reduced("fmin"), _reduced("fmax")  # of lanes of float32


def _pointer(context: Any, builder: Any, kind: Any, array: Any, element: Any, to: Any) -> Any:
    """Address of an element of a C-contiguous array, counted from its beginning, as a pointer to `to`."""
    data = arrayobj.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [element]), to.as_pointer())


@intrinsic
def load_row(_typing: Any, array: Any, row: Any) -> Any:
    """Row `row` of a C-contiguous array (…, WIDE) of float32, float64 or int32, which starts on a 64-byte boundary."""
    kind = lanes.Lanes(array.dtype)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        start = builder.mul(arguments[1], ir.IntType(64)(WIDE))
        return builder.load(_pointer(context, builder, array, arguments[0], start, lanes.llvm_type(kind)), align=64)

    return kind(array, types.int64), generate


@intrinsic
def store_row(_typing: Any, array: Any, row: Any, value: Any) -> Any:
    """Write lanes to where `load_row` reads them; a mask becomes −1 and 0 in an int32 array, a scalar is repeated."""
    kind = lanes.Lanes(array.dtype)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = arguments[2]
        if value == lanes.MASK:
            vector = builder.sext(vector, lanes.llvm_type(kind))
        elif not isinstance(value, lanes.Lanes):
            vector = lanes.widened(context, builder, vector, value, kind)
        start = builder.mul(arguments[1], ir.IntType(64)(WIDE))
        builder.store(vector, _pointer(context, builder, array, arguments[0], start, lanes.llvm_type(kind)), align=64)
        return context.get_dummy_value()

    return types.void(array, types.int64, value), generate


@intrinsic
def compare_and_swap(_typing: Any, array: Any, element: Any, expected: Any, new: Any) -> Any:
    """Write `new` to an element of a C-contiguous int64 array if `expected` is there, at once; whether it was."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _pointer(context, builder, array, arguments[0], arguments[1], ir.IntType(64))
        return builder.extract_value(builder.cmpxchg(place, *arguments[2:], "monotonic", "monotonic"), 1)

    return types.boolean(array, types.int64, types.int64, types.int64), generate


@intrinsic
def rows_at(_typing: Any, address: Any, rows: Any, columns: Any) -> Any:
    """A float32 array (rows, columns), C-contiguous, that stands at an address."""
    kind = types.Array(types.float32, 2, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, size = arrayobj.make_array(kind)(context, builder), ir.IntType(64)(4)
        data = builder.inttoptr(arguments[0], array.data.type)
        arrayobj.populate_array(array, data, arguments[1:], [builder.mul(arguments[2], size), size], size, None)
        return array._getvalue()

    return kind(types.int64, types.int64, types.int64), generate


def _transpose(builder: Any, rows: list[Any]) -> list[Any]:
    """Four vectors that hold four 4×4 blocks side by side, each block transposed."""

    def mix(a: Any, b: Any, order: list[int]) -> Any:
        mask = [block + (i if i < _FOUR else i - _FOUR + WIDE) for block in range(0, WIDE, _FOUR) for i in order]
        return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(lanes.INDEX, WIDE), mask))

    low, high = [0, 4, 1, 5], [2, 6, 3, 7]
    a, b, c, d = rows
    ac, bd = mix(a, c, low), mix(b, d, low)
    ac_high, bd_high = mix(a, c, high), mix(b, d, high)
    return [mix(ac, bd, low), mix(ac, bd, high), mix(ac_high, bd_high, low), mix(ac_high, bd_high, high)]


@intrinsic
def gather3(_typing: Any, array: Any, rows: Any) -> Any:
    """The triples of a C-contiguous array (n, 3) in the lanes' rows, three lanes of the array's own type.

    The array must own a fourth number behind its last triple, see `raytrace.kernel.arrays.aligned`.
    """
    kind = lanes.Lanes(array.dtype)
    element = lanes.llvm_type(kind).element
    four = ir.VectorType(element, _FOUR)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        quads = []
        for lane in range(WIDE):
            row = builder.sext(builder.extract_element(arguments[1], lanes.INDEX(lane)), ir.IntType(64))
            start = builder.mul(row, ir.IntType(64)(3))
            quads.append(builder.load(_pointer(context, builder, array, arguments[0], start, four), align=4))
        rows = []
        for first in range(_FOUR):  # lane `first` of every block of four
            parts = quads[first::_FOUR]
            halves = [_join(builder, parts[0], parts[1]), _join(builder, parts[2], parts[3])]
            rows.append(_join(builder, *halves))
        return context.make_tuple(builder, signature.return_type, _transpose(builder, rows)[:3])

    return types.UniTuple(kind, 3)(array, rows), generate


def _join(builder: Any, a: Any, b: Any) -> Any:
    size = 2 * a.type.count
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(lanes.INDEX, size), list(range(size))))


@intrinsic
def gather(_typing: Any, array: Any, places: Any) -> Any:
    """Elements of a C-contiguous array in the lanes' places, counted from its beginning, as lanes of its type."""
    kind = lanes.Lanes(array.dtype)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        found = ir.Constant(lanes.llvm_type(kind), ir.Undefined)
        for lane in range(WIDE):
            place = builder.sext(builder.extract_element(arguments[1], lanes.INDEX(lane)), ir.IntType(64))
            value = builder.load(_pointer(context, builder, array, arguments[0], place, found.type.element))
            found = builder.insert_element(found, value, lanes.INDEX(lane))
        return found

    return kind(array, places), generate


@intrinsic
def scatter4(_typing: Any, array: Any, begin: Any, places: Any, mask: Any, values: Any) -> Any:
    """Write four float32 lanes as four neighbours each, from the lanes' places on, where the mask is set.

    Args: array: float32, C-contiguous; begin: place in it from which `places` are counted, int64.
    """
    four = ir.VectorType(ir.FloatType(), _FOUR)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target, origin, at, wanted, given = arguments
        rows = _transpose(builder, [builder.extract_value(given, i) for i in range(_FOUR)])
        for lane in range(WIDE):
            with builder.if_then(builder.extract_element(wanted, lanes.INDEX(lane))):
                place = builder.sext(builder.extract_element(at, lanes.INDEX(lane)), ir.IntType(64))
                place = builder.add(place, origin)
                block = [lane // _FOUR * _FOUR + i for i in range(_FOUR)]
                order = ir.Constant(ir.VectorType(lanes.INDEX, _FOUR), block)
                row = rows[lane % _FOUR]
                part = builder.shuffle_vector(row, ir.Constant(row.type, ir.Undefined), order)
                builder.store(part, _pointer(context, builder, array, target, place, four), align=4)
        return context.get_dummy_value()

    return types.void(array, types.int64, places, mask, values), generate
