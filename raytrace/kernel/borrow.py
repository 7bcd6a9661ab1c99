"""Arrays in kernels without reference counting, which costs more than most of what a hot loop does with them."""

from __future__ import annotations

from typing import Any

from .deferred import arrayobj, cgutils, types
from .jit import intrinsic


@intrinsic
def borrow(_context: Any, value: Any) -> Any:
    """`value`, an array, a named tuple of arrays and scalars, or None, as views that own nothing.

    Taking a member of a tuple or a slice of an array counts a reference up and down, atomically. A kernel's arguments
    outlive it, so it borrows them once at its beginning and every later count is left out.
    """

    def uncounted(context: Any, builder: Any, kind: Any, one: Any) -> Any:
        if not isinstance(kind, types.Array):
            return one
        array = arrayobj.make_array(kind)(context, builder, one)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (kind,), (given,) = signature.args, arguments
        if isinstance(kind, types.Array):
            return uncounted(context, builder, kind, given)
        if kind == types.none:
            return given
        members = [
            uncounted(context, builder, member, builder.extract_value(given, position))
            for position, member in enumerate(kind.types)
        ]
        return context.make_tuple(builder, kind, members)

    return value(value), generate
