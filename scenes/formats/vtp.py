"""VTK files of polygons, read, and written with obscurance as point data.

An own reader, so that VTK, of 100 MB, is not needed. Format: VTK XML formats, PolyData. What is written has its arrays
inline, in base64 after their lengths; what is read may have them as text, appended or compressed, too.
"""

import lzma
import re
import zlib
from base64 import b64decode, b64encode
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from obscurance.ao import Bake
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Int64s

from ..asset.asset import Asset
from ..asset.primitive import BAKED, NORMAL, Column, ColumnSet, Primitive, W, float_normals, known_columns
from ..geometry.polygons import strip_triangles
from .table import MeshInput

_APPENDED = re.compile(rb"<AppendedData\b[^>]*?encoding\s*=\s*[\"'](raw|base64)[\"'][^>]*>\s*_")
_DECOMPRESSORS: dict[str, Any] = {
    "vtkZLibDataCompressor": zlib.decompressobj, "vtkLZMADataCompressor": lzma.LZMADecompressor,
}  # fmt: skip
_GROWTH, _SPARE = 1100, 1 << 24  # deflate grows 1032-fold at most
_TYPES = {"float32": "Float32", "float64": "Float64", "int64": "Int64", "uint8": "UInt8"}
_HEADER = '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">'


def vtp(bake: Bake, asset: Asset, _: object) -> bytes:
    """The vertices and polygons of the source with `obscurance`, float, and as far as they are known `error`, `flags`,
    `bent_normals` and `Normals`, the source's own."""
    mesh = asset.mesh
    known = known_columns(bake)
    columns = {W if name == "w" else name: known[name] for name in BAKED if name in known}
    if mesh.normals is not None:
        columns["Normals"] = float_normals(mesh.normals)
    point_data = [_array(name, values) for name, values in columns.items()]
    lines = [
        _HEADER,
        "<PolyData>",
        f'<Piece NumberOfPoints="{len(mesh.vertices)}" NumberOfPolys="{len(asset.sizes)}">',
        '<PointData Scalars="obscurance">',
        *point_data,
        "</PointData>",
        "<Points>",
        _array("Points", mesh.vertices),
        "</Points>",
        "<Polys>",
        _array("connectivity", asset.corners),
        _array("offsets", np.cumsum(asset.sizes)),
        "</Polys>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>\n",
    ]
    return "\n".join(lines).encode()


def _array(name: str, values: npt.NDArray[Any]) -> str:
    """A `DataArray` element of values, in base64 behind their number of bytes."""
    content = values.tobytes()
    encoded = b64encode(len(content).to_bytes(8, "little") + content).decode()
    components = values.shape[1] if values.ndim > 1 else 1
    of_what = f'type="{_TYPES[values.dtype.name]}" Name="{name}" NumberOfComponents="{components}"'
    return f'<DataArray {of_what} format="binary">{encoded}</DataArray>'


@dataclass
class _Document:
    """A file's elements, and how their arrays are stored."""

    root: ElementTree.Element
    source: str
    appended: bytes = b""
    raw: bool = False  # whether what is appended is no base64

    @classmethod
    def of(cls, data: bytes, source: str) -> "_Document":
        """Raises: MeshError: another document, or compressed as nobody here knows. ParseError: no XML."""
        found = _APPENDED.search(data)
        text = data[: found.start()] + b"</VTKFile>" if found else data
        if b"<!DOCTYPE" in text:
            raise MeshError(source, "content", "no document type", "one")
        root = ElementTree.fromstring(text)
        if root.tag != "VTKFile" or root.get("type") != "PolyData":
            raise MeshError(source, "content", "a VTKFile of PolyData", root.get("type", root.tag))
        if (by := root.get("compressor")) and by not in _DECOMPRESSORS:
            raise MeshError(source, "compressor", " or ".join(_DECOMPRESSORS), by)
        if found is None:
            return cls(root, source)
        return cls(root, source, data[found.end() : data.rfind(b"</AppendedData")], found[1] == b"raw")

    def values(self, array: ElementTree.Element) -> npt.NDArray[Any]:
        """The numbers of a `DataArray`, (n,) or (n, components). Raises: ValueError, KeyError: malformed ones."""
        order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        kind = np.dtype(array.get("type", "").lower())  # Float32, UInt8 and such
        if kind.kind not in "fiu":
            raise ValueError(f"an array of {kind}")
        kind = np.dtype(order + kind.str[1:])
        form = array.get("format", "ascii")
        if form == "ascii":
            text = (array.text or "").strip()
            numbers = (np.fromstring(text, sep=" ") if text else np.empty(0)).astype(kind)
        else:
            content = (array.text or "").encode()
            if form == "appended":
                offset = int(array.get("offset", "0"))
                ends = [int(other.get("offset", "0")) for other in self.root.iter("DataArray")]
                content = self.appended[offset : min((end for end in ends if end > offset), default=None)]
            if form != "appended" or not self.raw:  # pieces of base64, each with its padding
                pieces = re.findall(rb"[^=]+=*", b"".join(content.split()))
                content = b"".join(b64decode(piece, validate=True) for piece in pieces)
            numbers = np.frombuffer(self._unpacked(content, order), kind)
        components = int(array.get("NumberOfComponents", "1"))
        return numbers.reshape(-1, components) if components > 1 else numbers

    def _unpacked(self, content: bytes, order: str) -> bytes:
        """The bytes of an array, behind their length; or, compressed, behind the number of blocks, their length, that
        of the last one if it is shorter, and the compressed length of each."""
        word = np.dtype(order + ("u8" if self.root.get("header_type") == "UInt64" else "u4"))
        by = self.root.get("compressor")
        if not by:
            size = int(np.frombuffer(content, word, 1)[0])
            if word.itemsize + size > len(content):
                raise ValueError("an array that ends early")
            return content[word.itemsize : word.itemsize + size]
        count, size, last = np.frombuffer(content, word, 3).tolist()
        lengths = np.frombuffer(content, word, count, 3 * word.itemsize).tolist()
        total = size * count - (size - last if last else 0)
        if not size or total > _GROWTH * len(content) + _SPARE:
            raise ValueError("blocks larger than what their bytes can hold")
        check_memory(self.source, 2 * total, f"to read {total:,} bytes")
        start = (3 + count) * word.itemsize
        blocks = []
        for length in lengths:
            blocks.append(_DECOMPRESSORS[by]().decompress(content[start : start + length], size))
            start += length
        return b"".join(blocks)

    def cells(self, piece: ElementTree.Element, kind: str) -> tuple[Int64s, Int64s]:
        """Corners and sizes of a piece's "Polys" or "Strips". Raises: ValueError, KeyError: as `values`."""
        arrays = {array.get("Name"): array for array in piece.iterfind(f"{kind}/DataArray")}
        if not arrays:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        corners, ends = (self.values(arrays[name]).astype(np.int64) for name in ("connectivity", "offsets"))
        return corners, np.diff(ends, prepend=0)


def read_vtp(mesh_input: MeshInput) -> Asset:
    """The polygons and strips of each piece, with the points' normals and texture coordinates, and w of a bake.

    Raises: MeshError: as `_Document.of`. Exception: of malformed arrays.
    """
    document = _Document.of(mesh_input.file.read(), mesh_input.source)
    found = [piece for piece in document.root.iterfind("PolyData/Piece") if piece.find("Points/DataArray") is not None]
    unread: dict[str, None] = {}
    primitives = [_primitive(document, piece, unread) for piece in found]
    names = [f"{mesh_input.name}[{number}]" for number in range(len(found))] if len(found) > 1 else [mesh_input.name]
    return Asset.several(mesh_input.path, names, primitives, unread=tuple(unread))


def _primitive(document: _Document, piece: ElementTree.Element, unread: dict[str, None]) -> Primitive:
    """One piece of a document. Args: unread: gets what is left out, in words."""
    points = document.values(next(piece.iterfind("Points/DataArray")))
    corners, sizes = document.cells(piece, "Polys")
    if (sizes < 0).any() or sizes.sum() != len(corners):
        raise ValueError("offsets of polygons that do not ascend to the number of their corners")
    is_polygon = sizes >= 3
    strips = strip_triangles(*document.cells(piece, "Strips"))
    corners = np.concatenate([corners[np.repeat(is_polygon, sizes)], strips.ravel()])
    sizes = np.concatenate([sizes[is_polygon], np.full(len(strips), 3)])
    # Columns of points; others are left out.
    data = piece.find("PointData")
    arrays = {} if data is None else {array.get("Name", ""): array for array in data.iterfind("DataArray")}
    active = {} if data is None else data.attrib
    names = {NORMAL: active.get("Normals", "Normals"), W: W, "uv0": active.get("TCoords", "")}
    names |= {column: name for name, column in BAKED.items() if W in arrays and column != W}
    found = {key: document.values(arrays[name]) for key, name in names.items() if name in arrays}
    if any(len(values) != len(points) for values in found.values()):
        raise ValueError("columns of points that are not one row a point")
    for name in BAKED.values() & found.keys():  # other columns may have that name
        if found[name].shape[1:] != ((3,) if name == BAKED["bent_normals"] else ()):
            del found[name]
    if "uv0" in found:
        found["uv0"] = found["uv0"][:, :2]
    unread |= dict.fromkeys(f"{name} of points" for name in sorted(arrays.keys() - {*names.values()}))
    columns = ColumnSet({key: Column(values) for key, values in found.items()})
    return Primitive.of(points, corners, sizes, document.source, columns=columns)


FORMATS = (
    {
        "ending": ".vtp",
        "name": "VTK",
        "read": "obscurance.scenes.formats.vtp:read_vtp",
        "peak": 10.0,
        "begins": rb"(?s)\s*(<\?xml.*?\?>\s*)?(<!--.*?-->\s*)*<VTKFile\b[^>]*PolyData",
        "write": "obscurance.scenes.formats.vtp:vtp",
        "holds": ("source", "w"),
    },
)
