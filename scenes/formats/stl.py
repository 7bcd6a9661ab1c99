"""STL, binary and text: three vertices a triangle, none shared.

An own reader because no count of a header is to be trusted, and memory stays bounded: estimated at 6 times the bytes of
a file, where what trimesh reads takes 22 times (docs/reliability.md).
Format: 3D Systems, StereoLithography interface specification, 1989.
"""

from __future__ import annotations

import re

import numpy as np

from raytrace.errors import MeshError

from ..geometry.instances import Instance

HEADER, TRIANGLE = 84, np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_LINE = re.compile(r"^[ \t]*(solid|vertex|endsolid)\b[ \t]*([^\n]*)", re.MULTILINE | re.IGNORECASE)


def read_stl(data: bytes, name: str, source: str) -> list[Instance]:
    """The triangles; the solids of a text file one by one. The stored face normals are not read.

    Args:
        data: the file's bytes. They are binary if their number is the one that a binary header announces.
        name: what to call the only object of a file.
        source: the file's name for messages.

    Raises:
        MeshError: the file ends early, or is no STL.
        ValueError: text that is not numbers.
    """
    announced = int.from_bytes(data[80:HEADER], "little")
    if len(data) == HEADER + announced * TRIANGLE.itemsize:
        rows = np.frombuffer(data, TRIANGLE, announced, HEADER)
        return [_instance(name, rows["vertices"].reshape(-1, 3))]
    solids = _solids(data.decode("utf-8", "replace").replace("\r", "\n"), source)
    return [_instance(label if len(solids) > 1 else name, vertices) for label, vertices in solids]


def _instance(name: str, vertices: np.ndarray) -> Instance:
    return Instance(name, vertices, np.arange(len(vertices)).reshape(-1, 3), up="z")


def _solids(text: str, source: str) -> list[tuple[str, np.ndarray]]:
    """Name and vertices (n, 3) of each solid that has some."""
    solids: list[tuple[str, np.ndarray]] = []
    name, numbers = "", list[str]()
    is_open = False
    for keyword, rest in _LINE.findall(text):
        match keyword.lower(), is_open:
            case "solid", False:
                name, numbers, is_open = rest.strip(), [], True
            case "vertex", True:
                numbers.append(rest)
            case "endsolid", True:
                is_open = False
                if numbers:
                    solids.append((name, np.fromstring(" ".join(numbers), sep=" ").reshape(-1, 3)))
            case _:
                raise _damaged(source)
    if is_open or not solids:
        raise _damaged(source)
    return solids


def _damaged(source: str) -> MeshError:
    return MeshError(source, "content", "complete ASCII or binary STL", "neither: damaged or cut off")
