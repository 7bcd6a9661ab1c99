"""Sixteen numbers at once: a vector type for kernels, which the compiler keeps in SIMD registers.

Lanes of float32, float64, int32 or booleans combine with each other and with scalars by the usual operators, `min`,
`max`, `abs`, `sqrt` and `exp`; a comparison makes booleans, and `select` chooses by them. A helper written with these,
without branches on its values, serves scalars and lanes alike: `raytrace.kernel.vector` is made of such. The type
itself is in `raytrace.kernel.lanes`.
"""

from collections.abc import Callable
from typing import Any

from .deferred import ir, lanes, types
from .jit import intrinsic

WIDE = 16


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
