"""JSON of a glTF file as records; what does not match is refused by name.

Whole numbers are indices and sizes, from 0; whether they point at something is found where they are used.
"""

from typing import Annotated, Any, TypeVar

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.system.records import Fault, Within, read
from obscurance.raytrace.text.field_errors import shown

T = TypeVar("T")
Index = Annotated[int, Within(0, 2**53 - 1, words="a whole number, 0 or more")]
Number = Annotated[float, Within(-1e100, 1e100, words="a finite number")]


def parse(kind: type[T], value: Any, source: object) -> T:
    """`value` as `kind`. Raises: MeshError: the first value that is not of its type, by its path."""
    try:
        return read(kind, value)
    except Fault as fault:
        raise MeshError(source, fault.place or "content", fault.expected, shown(fault.got)) from None
