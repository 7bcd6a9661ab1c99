"""Sixteen numbers at once: a vector type for kernels, which the compiler keeps in SIMD registers.

Lanes of float32, float64, int32 or booleans combine with each other and with scalars by the usual operators, `min`,
`max`, `abs`, `sqrt` and `exp`; a comparison makes booleans, and `select` chooses by them. A helper written with these,
without branches on its values, serves scalars and lanes alike: `raytrace.kernel.vector` is made of such. The type
itself is in `raytrace.kernel.lanes`.
"""

from .jit import arrayobj, intrinsic, ir, lanes, types

WIDE = 16
SHORT = 9  # numbers of a short row
_FOUR, _EIGHT = 4, 8


@intrinsic(lambda condition, a, b: lanes.selection(condition, a, b))
def select(context, builder, signature, condition, a, b):
    """a where the condition holds, else b, both of them evaluated. Lanes may be mixed with scalars; two scalars
    make lanes of float32 or int32."""
    _, kind_of_a, kind_of_b = signature.args
    x = lanes.widened(context, builder, a, kind_of_a, signature.return_type)
    y = lanes.widened(context, builder, b, kind_of_b, signature.return_type)
    return builder.select(condition, x, y)


@intrinsic(lambda a: lanes.SINGLE(a))
def single(context, builder, signature, a):
    """Lanes of float64 rounded to float32."""
    return builder.fptrunc(a, lanes.llvm_type(lanes.SINGLE))


@intrinsic(lambda a: lanes.DOUBLE(a))
def double(context, builder, signature, a):
    """Lanes of float32 or int32 as float64, exactly."""
    convert = builder.sitofp if isinstance(a.type.element, ir.IntType) else builder.fpext
    return convert(a, lanes.llvm_type(lanes.DOUBLE))


@intrinsic(lambda a, b, c: lanes.SINGLE(a, b, c))
def multiply_add(context, builder, signature, a, b, c):
    """a b + c of lanes of float32, scalars repeated; rounded once where the processor can (FMA)."""
    pairs = zip((a, b, c), signature.args, strict=True)
    operands = [lanes.widened(context, builder, value, kind, lanes.SINGLE) for value, kind in pairs]
    return lanes.in_each_lane(builder, "llvm.fmuladd", operands)


@intrinsic(lambda a: lanes.SINGLE(a))
def reciprocal_root(context, builder, signature, a):
    """1/√a of lanes of float32 above 0, to about 2⁻²⁰: by the processor's estimate and a step of Newton's method."""
    one = lanes.widened(context, builder, ir.Constant(ir.FloatType(), 1.0), types.float32, lanes.SINGLE)
    return builder.fdiv(one, lanes.in_each_lane(builder, "llvm.sqrt", [a]), flags=("arcp", "contract", "reassoc"))


@intrinsic(lambda: lanes.WHOLE())
def lane_numbers(context, builder, signature):
    """The lanes 0, 1, … 15 as int32."""
    return ir.Constant(lanes.llvm_type(lanes.WHOLE), list(range(WIDE)))


def _bits(builder, mask):
    """A mask of lanes as an integer of as many bits."""
    return builder.bitcast(mask, ir.IntType(WIDE))


@intrinsic(lambda mask: types.boolean(mask))
def some(context, builder, signature, mask):
    """Whether any lane of a mask is set."""
    return builder.icmp_unsigned("!=", _bits(builder, mask), ir.IntType(WIDE)(0))


@intrinsic(lambda mask: types.int64(mask))
def count(context, builder, signature, mask):
    """How many lanes of a mask are set, int64."""
    return builder.zext(builder.ctpop(_bits(builder, mask)), ir.IntType(64))


@intrinsic(lambda mask: types.int64(mask))
def bits(context, builder, signature, mask):
    """The lanes that are set, as the lowest bits of an int64."""
    return builder.zext(_bits(builder, mask), ir.IntType(64))


@intrinsic(lambda number: types.int64(types.int64))
def lowest_bit(context, builder, signature, number):
    """The place of the lowest bit that is set in an int64 that is not 0, int64."""
    return builder.cttz(number, ir.IntType(1)(0))


@intrinsic(lambda number: types.int64(types.int64))
def popcount(context, builder, signature, number):
    """How many bits of an int64 are set, int64."""
    return builder.ctpop(number)


@intrinsic(lambda a, lane: a.dtype(a, types.int64))
def pick(context, builder, signature, a, lane):
    """The value in one lane of `a`, a scalar."""
    return builder.extract_element(a, lane)


@intrinsic(lambda a, lane, value: a(a, types.int64, value))
def replace(context, builder, signature, a, lane, value):
    """`a` with another value in one lane."""
    lanes_kind, _, kind = signature.args
    return builder.insert_element(a, context.cast(builder, value, kind, lanes_kind.dtype), lane)


def _reduced(name):
    """A function that reduces lanes of float32 to a scalar, by LLVM's reduction of this name."""

    @intrinsic(lambda a: a.dtype(a))
    def reduce(context, builder, signature, a):
        kind = ir.FunctionType(a.type.element, [a.type])
        return builder.call(builder.module.declare_intrinsic(f"llvm.vector.reduce.{name}.v{WIDE}f32", (), kind), [a])

    return reduce


lowest = _reduced("fmin")  # of lanes of float32
highest = _reduced("fmax")  # of lanes of float32


def _pointer(context, builder, kind, array, element, to):
    """Address of an element of a C-contiguous array, counted from its beginning, as a pointer to `to`."""
    data = arrayobj.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [element]), to.as_pointer())


def _row(context, builder, kind, array, row):
    """Address of a row of lanes of a C-contiguous array."""
    start = builder.mul(row, ir.IntType(64)(WIDE))
    return _pointer(context, builder, kind, array, start, lanes.llvm_type(kind))


@intrinsic(lambda array, row: lanes.Lanes(array.dtype)(array, types.int64))
def load_row(context, builder, signature, array, row):
    """Row `row` of a C-contiguous array (…, WIDE) of float32, float64 or int32, which starts on a 64-byte boundary."""
    return builder.load(_row(context, builder, signature.args[0], array, row), align=64)


@intrinsic(lambda array, row, value: types.void(array, types.int64, value))
def store_row(context, builder, signature, array, row, value):
    """Write lanes to where `load_row` reads them; a mask becomes −1 and 0 in an int32 array, a scalar is repeated."""
    target, _, kind = signature.args
    if kind == lanes.MASK:
        value = builder.sext(value, lanes.llvm_type(target))
    value = lanes.widened(context, builder, value, kind, lanes.Lanes(target.dtype))
    builder.store(value, _row(context, builder, target, array, row), align=64)
    return context.get_dummy_value()


def _short_row(context, builder, kind, array, row):
    """Addresses of the first eight numbers of a short row, and of the ninth."""
    start = builder.mul(row, ir.IntType(64)(SHORT))
    first = _pointer(context, builder, kind, array, start, ir.VectorType(ir.FloatType(), _EIGHT))
    return first, _pointer(context, builder, kind, array, builder.add(start, ir.IntType(64)(_EIGHT)), ir.FloatType())


@intrinsic(lambda array, row: lanes.SINGLE(array, types.int64))
def load_short_row(context, builder, signature, array, row):
    """Row `row` of a C-contiguous float32 array (…, SHORT) in the first lanes; the others are 0."""
    first, ninth = _short_row(context, builder, signature.args[0], array, row)
    eight = builder.load(first, align=4)
    wide = _shuffle(builder, eight, ir.Constant(eight.type, None), list(range(WIDE)))
    return builder.insert_element(wide, builder.load(ninth), lanes.INDEX(_EIGHT))


@intrinsic(lambda array, row, value: types.void(array, types.int64, lanes.SINGLE))
def store_short_row(context, builder, signature, array, row, value):
    """Write the first lanes to where `load_short_row` reads them."""
    first, ninth = _short_row(context, builder, signature.args[0], array, row)
    builder.store(_shuffle(builder, value, value, list(range(_EIGHT))), first, align=4)
    builder.store(builder.extract_element(value, lanes.INDEX(_EIGHT)), ninth)
    return context.get_dummy_value()


@intrinsic(lambda array, *others: types.boolean(array, *[types.int64] * len(others)))
def compare_and_swap(context, builder, signature, array, element, expected, new):
    """Write `new` to an element of a C-contiguous int64 array if `expected` is there, at once; whether it was."""
    address = _pointer(context, builder, signature.args[0], array, element, ir.IntType(64))
    return builder.extract_value(builder.cmpxchg(address, expected, new, "monotonic", "monotonic"), 1)


@intrinsic(lambda *_: types.Array(types.float32, 2, "C")(types.int64, types.int64, types.int64))
def rows_at(context, builder, signature, address, rows, columns):
    """A float32 array (rows, columns), C-contiguous, that stands at an address."""
    array = arrayobj.make_array(signature.return_type)(context, builder)
    size = ir.IntType(64)(4)
    data = builder.inttoptr(address, array.data.type)
    arrayobj.populate_array(array, data, (rows, columns), [builder.mul(columns, size), size], size, None)
    return array._getvalue()


def _transpose(builder, vectors):
    """Four vectors that hold four 4×4 blocks side by side, each block transposed."""

    def mix(a, b, order):
        """Four-lane blocks of the vectors a and b shuffled by `order`, numbers from 4 on being of b."""
        mask = [block + (i if i < _FOUR else i - _FOUR + WIDE) for block in range(0, WIDE, _FOUR) for i in order]
        return _shuffle(builder, a, b, mask)

    low = [0, 4, 1, 5]
    high = [2, 6, 3, 7]
    a, b, c, d = vectors
    ac = mix(a, c, low)
    bd = mix(b, d, low)
    ac_high = mix(a, c, high)
    bd_high = mix(b, d, high)
    return [mix(ac, bd, low), mix(ac, bd, high), mix(ac_high, bd_high, low), mix(ac_high, bd_high, high)]


def _shuffle(builder, a, b, order):
    """LLVM's shuffle of two vectors by constant places in both, one after the other."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(lanes.INDEX, len(order)), order))


def _place(builder, places, lane):
    """The lane's number in `places`, as int64."""
    return builder.sext(builder.extract_element(places, lanes.INDEX(lane)), ir.IntType(64))


@intrinsic(lambda array, row_numbers: types.UniTuple(lanes.Lanes(array.dtype), 3)(array, row_numbers))
def gather3(context, builder, signature, array, row_numbers):
    """The triples of a C-contiguous array (n, 3) in the lanes' rows, three lanes of the array's own type. The array
    must own a fourth number behind its last triple, see `raytrace.kernel.arrays.aligned`."""
    kind = signature.args[0]
    four = ir.VectorType(lanes.ELEMENT[kind.dtype], _FOUR)
    quads = []
    for lane in range(WIDE):
        start = builder.mul(_place(builder, row_numbers, lane), ir.IntType(64)(3))
        quads.append(builder.load(_pointer(context, builder, kind, array, start, four), align=4))

    def join(a, b):
        return _shuffle(builder, a, b, list(range(2 * a.type.count)))

    corners = [quads[k::_FOUR] for k in range(_FOUR)]  # lane k of every block of four
    joined = [join(join(a, b), join(c, d)) for a, b, c, d in corners]
    return context.make_tuple(builder, signature.return_type, _transpose(builder, joined)[:3])


@intrinsic(lambda array, places: lanes.Lanes(array.dtype)(array, places))
def gather(context, builder, signature, array, places):
    """Elements of a C-contiguous array in the lanes' places, counted from its beginning, as lanes of its type."""
    gathered = ir.Constant(lanes.llvm_type(signature.return_type), ir.Undefined)
    for lane in range(WIDE):
        element = _place(builder, places, lane)
        value = builder.load(_pointer(context, builder, signature.args[0], array, element, gathered.type.element))
        gathered = builder.insert_element(gathered, value, lanes.INDEX(lane))
    return gathered


@intrinsic(lambda array, begin, *others: types.void(array, types.int64, *others))
def scatter4(context, builder, signature, array, begin, places, mask, values):
    """Write four float32 lanes as four neighbours each, from the lanes' places on, where the mask is set. `places` are
    counted from the place `begin` of a C-contiguous float32 array."""
    quads = _transpose(builder, [builder.extract_value(values, i) for i in range(_FOUR)])
    for lane in range(WIDE):
        with builder.if_then(builder.extract_element(mask, lanes.INDEX(lane))):
            element = builder.add(_place(builder, places, lane), begin)
            row = quads[lane % _FOUR]
            first_number = lane // _FOUR * _FOUR
            part = _shuffle(
                builder, row, ir.Constant(row.type, ir.Undefined), list(range(first_number, first_number + _FOUR))
            )
            builder.store(part, _pointer(context, builder, signature.args[0], array, element, part.type), align=4)
    return context.get_dummy_value()
