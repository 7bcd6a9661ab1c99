"""Masks of lanes counted and searched, single lanes read and replaced, the largest and the least of all lanes."""

from typing import Any

from .deferred import ir, lanes, types
from .jit import intrinsic
from .simd import WIDE


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
