"""Arrays in kernels without reference counting, which costs more than most of what a hot loop does with them."""

from typing import Any

from .deferred import arrayobj, cgutils, types
from .jit import intrinsic


@intrinsic
def borrow(_context: Any, value: Any) -> Any:
    """`value`, an array, a named tuple of arrays, scalars and such tuples, or None, as views that own nothing.

    Taking a member of a tuple or a slice of an array counts a reference up and down, atomically. A kernel's arguments
    outlive it, so it borrows them once at its beginning and every later count is left out.
    """

    def uncounted(context: Any, builder: Any, kind: Any, one: Any) -> Any:
        if isinstance(kind, types.BaseTuple):
            members = [builder.extract_value(one, position) for position in range(len(kind.types))]
            borrowed = [uncounted(context, builder, *each) for each in zip(kind.types, members, strict=True)]
            return context.make_tuple(builder, kind, borrowed)
        if not isinstance(kind, types.Array):
            return one
        array = arrayobj.make_array(kind)(context, builder, one)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()

    return value(value), lambda context, builder, signature, given: uncounted(context, builder, value, given[0])
