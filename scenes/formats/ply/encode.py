"""Elements as the bytes of a binary PLY file."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.types import Int64s

from ...geometry.elements import Element
from .layout import COUNT, PlyElement, write_header


def encode_ply(elements: Sequence[Element], comments: Sequence[str]) -> bytes:
    """A binary little-endian PLY file. Args: comments: lines of the header, "comment …" or "obj_info …"."""
    fitting = [replace(each, properties=tuple(column.fitting() for column in each.properties)) for each in elements]
    layouts = [PlyElement(e.name, e.count, {c.name: (c.kind, c.counted) for c in e.properties}) for e in fitting]
    return b"".join([write_header(layouts, comments), *map(_rows, fitting, layouts)])


def _rows(element: Element, layout: PlyElement) -> bytes:
    """The rows of an element: packed together where their lists are equally long."""
    lists = [column.sizes for column in element.properties if column.sizes is not None]
    if all((sizes == sizes[:1]).all() for sizes in lists):
        return _packed(element, layout, slice(None)).tobytes()
    key = lists[0].astype(np.int64)
    for sizes in lists[1:]:
        key = np.unique(key, return_inverse=True)[1] * (int(sizes.max()) + 1) + sizes
    order = np.argsort(key.astype(np.uint16) if key.max() < 1 << 16 else key, kind="stable")  # of 16 bits much faster
    groups = np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
    packed = [_packed(element, layout, rows) for rows in groups]
    widths = np.empty(element.count, np.int64)
    for rows, group in zip(groups, packed, strict=True):
        widths[rows] = group.itemsize
    starts = np.cumsum(widths) - widths
    data = np.empty(int(widths.sum()), np.uint8)
    for rows, group in zip(groups, packed, strict=True):
        for byte, column in enumerate(group.view(np.uint8).reshape(len(rows), -1).T):
            data[starts[rows] + byte] = column
    return data.tobytes()


def _packed(element: Element, layout: PlyElement, rows: slice | Int64s) -> npt.NDArray[Any]:
    """Rows whose lists have the lengths of the first row's."""
    lengths, values = {}, {}
    for column in element.properties:
        values[column.name] = column.values[rows] if column.sizes is None else column.values
        if column.counted:
            sizes = column.values[:0] if column.sizes is None else column.sizes
            length = lengths[column.name] = int(sizes[rows][0]) if len(sizes) else 0
            if isinstance(rows, slice):
                values[column.name] = column.values.reshape(len(sizes), length)
            else:
                values[column.name] = column.values[(np.cumsum(sizes) - sizes)[rows][:, None] + np.arange(length)]
    made = np.empty(element.count if isinstance(rows, slice) else len(rows), layout.row(lengths))
    for name, own in values.items():
        made[name] = own
        if name in lengths:
            made[COUNT + name] = lengths[name]
    return made
