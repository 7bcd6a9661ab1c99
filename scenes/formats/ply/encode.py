"""Elements as the bytes of a binary PLY file.

Format: Greg Turk, The PLY polygon file format, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.types import Int64s, UInt8s

from ...geometry.elements import Element

NAMES = {
    "b": "char", "B": "uchar", "h": "short", "H": "ushort", "i": "int", "I": "uint", "f": "float", "d": "double",
    "q": "int64", "Q": "uint64",
}  # fmt: skip
"""The format's names of the types that NumPy calls by these letters."""


def encode_ply(elements: Sequence[Element], comments: Sequence[str]) -> bytes:
    """A binary little-endian PLY file. Args: comments: lines of the header, "comment …" or "obj_info …"."""
    lines = ["ply", "format binary_little_endian 1.0", *comments]
    data = []
    for element in elements:
        fitting = replace(element, properties=tuple(column.fitting() for column in element.properties))
        lines.append(f"element {element.name} {element.count}")
        for column in fitting.properties:
            counted = f"list {NAMES[column.counted]} " if column.counted else ""
            lines.append(f"property {counted}{NAMES[column.kind]} {column.name}")
        data.append(_rows(fitting))
    return b"".join(["\n".join([*lines, "end_header\n"]).encode("latin-1", "replace"), *data])


def _rows(element: Element) -> bytes:
    """The rows of an element, whatever the lengths of its lists."""
    if all(column.sizes is None or (column.sizes == column.sizes[:1]).all() for column in element.properties):
        return _even_rows(element)
    widths = np.zeros(element.count, np.int64)
    for column in element.properties:
        item = np.dtype(column.kind).itemsize
        widths += item if column.sizes is None else np.dtype(column.counted).itemsize + item * column.sizes
    starts = np.cumsum(widths) - widths
    data = np.zeros(int(widths.sum()), np.uint8)
    for column in element.properties:
        if column.sizes is None:
            starts = _scatter(data, starts, column.values.astype("<" + column.kind))
            continue
        sizes = column.sizes.astype(np.int64)
        starts = _scatter(data, starts, sizes.astype("<" + column.counted))
        item = np.dtype(column.kind).itemsize
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        _scatter(data, np.repeat(starts, sizes) + item * within, column.values.astype("<" + column.kind))
        starts = starts + item * sizes
    return data.tobytes()


def _even_rows(element: Element) -> bytes:
    fields: list[Any] = []
    for number, column in enumerate(element.properties):
        if column.sizes is None:
            fields.append((f"v{number}", "<" + column.kind))
        else:
            length = int(column.sizes[0]) if len(column.sizes) else 0
            fields += [(f"n{number}", "<" + column.counted), (f"v{number}", "<" + column.kind, (length,))]
    rows = np.empty(element.count, np.dtype(fields))
    for number, column in enumerate(element.properties):
        values = column.values
        if column.sizes is not None:
            rows[f"n{number}"] = column.sizes
            values = values.reshape(element.count, -1) if len(values) else values.reshape(element.count, 0)
        rows[f"v{number}"] = values
    return rows.tobytes()


def _scatter(data: UInt8s, starts: Int64s, values: npt.NDArray[Any]) -> Int64s:
    """Write each value's bytes where it starts; where each ends."""
    item = values.dtype.itemsize
    each = np.ascontiguousarray(values).view(np.uint8).reshape(-1, item)
    for byte in range(item):
        data[starts + byte] = each[:, byte]
    return starts + item
