"""Numba's side of `raytrace.kernel.simd`, sixteen numbers as LLVM's vectors, and records as kernels have them."""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_getattr_generic
from numba.core.registry import cpu_target
from numba.core.types.containers import BaseNamedTuple, BaseTuple
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import lower_builtin, models, register_model, type_callable

from .simd import WIDE


class Lanes(types.Type):
    """`WIDE` values of one Numba scalar type."""

    def __init__(self, dtype: types.Type) -> None:
        self.dtype = dtype
        super().__init__(name=f"Lanes({dtype})")


SINGLE = Lanes(types.float32)
DOUBLE = Lanes(types.float64)
WHOLE = Lanes(types.int32)
MASK = Lanes(types.boolean)
ELEMENT = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.int32: ir.IntType(32),
    types.boolean: ir.IntType(1),
}
INDEX = ir.IntType(32)


def llvm_type(kind: Any) -> ir.VectorType:
    """LLVM's vector type of lanes of a kind, or of a row of an array of it."""
    return ir.VectorType(ELEMENT[kind.dtype], WIDE)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, llvm_type(kind))


def widened(context: Any, builder: Any, value: Any, kind: types.Type, wanted: types.Type) -> Any:
    """A value of a kind as one of the `wanted` kind; scalars are cast, and repeated where lanes are wanted."""
    if isinstance(kind, Lanes):
        return value
    if not isinstance(wanted, Lanes):
        return context.cast(builder, value, kind, wanted)
    nothing = ir.Constant(llvm_type(wanted), ir.Undefined)
    in_lane_0 = builder.insert_element(nothing, context.cast(builder, value, kind, wanted.dtype), INDEX(0))
    return builder.shuffle_vector(in_lane_0, nothing, ir.Constant(ir.VectorType(INDEX, WIDE), None))


def common(*kinds: types.Type) -> Lanes | None:
    """The one type of lanes among `kinds`, None if there are several; what is no lanes must be a scalar."""
    vectors = {kind for kind in kinds if isinstance(kind, Lanes)}
    scalars = all(isinstance(kind, Lanes | types.Number | types.Boolean) for kind in kinds)
    return vectors.pop() if len(vectors) == 1 and scalars else None


def selection(condition: types.Type, a: types.Type, b: types.Type) -> Any:
    """The signature of `select`, None if there is none."""
    kind = common(a, b) or cpu_target.typing_context.unify_types(a, b)
    if kind and isinstance(condition, Lanes) and not isinstance(kind, Lanes):
        kind = SINGLE if isinstance(kind, types.Float) else WHOLE
    return kind and kind(condition, a, b)


def _operator(function: Any, emit: Callable[..., Any], result: Callable[[Lanes], Lanes] = lambda lanes: lanes) -> None:
    """Give an operator of two arguments to lanes; `emit(builder, is_float, a, b)` makes its code."""

    @type_callable(function)
    def infer(context: Any) -> Any:
        """Numba's typing of the operator for lanes: a function of the types of both arguments."""

        def typer(a: Any, b: Any) -> Any:
            lanes = common(a, b)
            return lanes and result(lanes)

        return typer

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """LLVM's code of the operator, scalars widened to lanes first."""
        lanes = common(*signature.args)
        assert lanes
        a = widened(context, builder, arguments[0], signature.args[0], lanes)
        b = widened(context, builder, arguments[1], signature.args[1], lanes)
        return emit(builder, isinstance(lanes.dtype, types.Float), a, b)

    scalars = types.Number, types.Boolean
    for pair in ((Lanes, Lanes), *((Lanes, t) for t in scalars), *((t, Lanes) for t in scalars)):
        lower_builtin(function, *pair)(generate)


def _compared(sign: str) -> Callable[..., Any]:
    """The `emit` of a comparison by this sign, such as "<"."""

    def emit(b: Any, floats: bool, x: Any, y: Any) -> Any:
        if floats:
            return b.fcmp_unordered(sign, x, y) if sign == "!=" else b.fcmp_ordered(sign, x, y)
        return b.icmp_signed(sign, x, y)

    return emit


def _chosen(sign: str) -> Callable[..., Any]:
    """The `emit` of a minimum or a maximum: a where a sign b, else b."""
    return lambda b, floats, x, y: b.select(_compared(sign)(b, floats, x, y), x, y)


for _function in (operator.add, operator.iadd):
    _operator(_function, lambda b, floats, x, y: b.fadd(x, y) if floats else b.add(x, y))
for _function in (operator.mul, operator.imul):
    _operator(_function, lambda b, floats, x, y: b.fmul(x, y) if floats else b.mul(x, y))
_operator(operator.sub, lambda b, floats, x, y: b.fsub(x, y) if floats else b.sub(x, y))
_operator(operator.truediv, lambda b, floats, x, y: b.fdiv(x, y))
_operator(operator.and_, lambda b, floats, x, y: b.and_(x, y))
_operator(operator.or_, lambda b, floats, x, y: b.or_(x, y))
_operator(operator.rshift, lambda b, floats, x, y: b.ashr(x, y))
_operator(min, _chosen("<"))
_operator(max, _chosen(">"))
for _function, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="), (operator.eq, "=="),
    (operator.ne, "!="),
):  # fmt: skip
    _operator(_function, _compared(_sign), lambda lanes: MASK)


def in_each_lane(builder: Any, name: str, vectors: list[Any]) -> Any:
    """An LLVM intrinsic applied to whole vectors."""
    kind = vectors[0].type
    suffix = f"v{WIDE}f{64 if isinstance(kind.element, ir.DoubleType) else 32}"
    function = builder.module.declare_intrinsic(f"{name}.{suffix}", (), ir.FunctionType(kind, [kind] * len(vectors)))
    return builder.call(function, vectors)


_operator(operator.pow, lambda b, floats, x, y: in_each_lane(b, "llvm.pow", [x, y]))


def _unary(function: Any, emit: Callable[[Any, Any], Any]) -> None:
    """Give a function of one argument to lanes; `emit(builder, a)` makes its code."""

    @type_callable(function)
    def infer(context: Any) -> Any:
        return lambda a: a if isinstance(a, Lanes) else None

    lower_builtin(function, Lanes)(lambda context, builder, signature, arguments: emit(builder, arguments[0]))


_unary(operator.neg, lambda b, x: b.fneg(x))
_unary(operator.invert, lambda b, x: b.not_(x))
_unary(abs, lambda b, x: in_each_lane(b, "llvm.fabs", [x]))
_unary(math.exp, lambda b, x: in_each_lane(b, "llvm.exp", [x]))
_unary(math.sqrt, lambda b, x: in_each_lane(b, "llvm.sqrt", [x]))


class RecordView(types.Opaque):
    """The address of a named tuple, whose members are loaded where they are used."""

    def __init__(self, record: Any) -> None:
        self.record = record
        super().__init__(name=f"RecordView({record})")


register_model(RecordView)(models.OpaqueModel)


def view_type(kind: Any) -> Any:
    """The type of an argument as its kernel has it: of a named tuple, its address.

    Functions that it is passed to are small to compile: only `value.name` is left of it.
    """
    if isinstance(kind, BaseNamedTuple):
        return RecordView(kind)
    if isinstance(kind, BaseTuple):
        return BaseTuple.from_types(tuple(map(view_type, kind.types)))
    return kind


@infer_getattr
class _Members(AttributeTemplate):
    key = RecordView

    def generic_resolve(self, kind: Any, name: str) -> Any:
        """The type of a record's member of this name, as Numba asks for it."""
        record = kind.record
        return view_type(record.types[record.fields.index(name)]) if name in record.fields else None


@lower_getattr_generic(RecordView)
def _member(context: Any, builder: Any, kind: Any, address: Any, name: str) -> Any:
    """LLVM's code that loads a member of the record at an address; of a record within, its address."""
    number = kind.record.fields.index(name)
    record = builder.bitcast(address, context.get_value_type(kind.record).as_pointer())
    member = cgutils.gep_inbounds(builder, record, 0, number)
    if isinstance(view_type(kind.record.types[number]), RecordView):
        return builder.bitcast(member, cgutils.voidptr_t)
    return builder.load(member)
