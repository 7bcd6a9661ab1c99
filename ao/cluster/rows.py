"""Rows on their way from a worker, as bytes of declared lengths: nothing that a worker made is unpickled as rows."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from ..execute.work import Tables, Work


def pack(tables: Tables) -> tuple[bytes, ...]:
    """The content of each table; objects, which are JSON-ready, as JSON."""
    return tuple(json.dumps(table.tolist()).encode() if table.dtype == object else table.tobytes() for table in tables)


def unpack(work: Work, contents: Sequence[object]) -> Tables:
    """The tables of `work` that `pack` has packed.

    Raises:
        ValueError: these are contents of other tables.
    """
    tables = work.tables()
    for table, content in zip(tables, contents, strict=True):
        if not isinstance(content, bytes):
            raise ValueError(f"expected bytes, got {type(content).__name__}")
        values = np.array(json.loads(content)) if table.dtype == object else np.frombuffer(content, table.dtype)
        table[...] = values.reshape(table.shape)
    return tables
