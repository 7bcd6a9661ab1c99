"""VTK files of polygons made by hand: arrays as text, in base64, appended and compressed, as VTK writes them."""

import lzma
import zlib
from base64 import b64encode

import numpy as np

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [3, 0, 0]], "f4")
NORMALS = np.tile(np.array([0, 0, 1], "f4"), (7, 1))
UV = POINTS[:, :2] / 4
POLYGONS, STRIPS = [[0, 1, 2, 3], [0, 1], [0, 1, 2]], [[1, 4, 2, 5], [4, 6, 5]]
FACES = [[0, 1, 2], [0, 2, 3], [0, 1, 2], [1, 4, 2], [5, 2, 4], [4, 6, 5]]
COMPRESSORS = {"": None, "vtkZLibDataCompressor": zlib.compress, "vtkLZMADataCompressor": lzma.compress}
FORMS = ["ascii", "binary", "appended base64", "appended raw"]
_TYPES = {"f4": "Float32", "i8": "Int64", "i4": "Int32"}


class Writer:
    """Arrays of a document in one form."""

    def __init__(self, form, compressor="", order="<", word="u4"):
        self.form, self.order, self.word = form, order, np.dtype(order + word)
        self.compressor, self.appended = compressor, b""

    def content(self, data):
        """A length and the data, or blocks of 40 bytes, as the two or one pieces that are encoded."""
        if not self.compressor:
            return np.array([len(data)], self.word).tobytes(), data
        blocks = [data[at : at + 40] for at in range(0, len(data), 40)]
        packed = [COMPRESSORS[self.compressor](block) for block in blocks]
        lengths = [len(blocks), 40, len(data) % 40, *map(len, packed)]
        return np.array(lengths, self.word).tobytes(), b"".join(packed)

    def array(self, name, values, kind):
        values = np.asarray(values)
        shape = f'NumberOfComponents="{values.shape[1] if values.ndim > 1 else 1}"'
        head = f'<DataArray type="{_TYPES[kind]}" Name="{name}" {shape} format="{self.form.split()[0]}"'
        if self.form == "ascii":
            return f"{head}>\n {' '.join(map(str, values.ravel().tolist()))}\n </DataArray>"
        pieces = self.content(values.astype(self.order + kind).tobytes())
        encoded = b"".join(pieces) if self.form.endswith("raw") else b"".join(map(b64encode, pieces))
        if self.form == "binary":
            return f"{head}>\n  {encoded.decode()}\n</DataArray>"
        offset, self.appended = len(self.appended), self.appended + encoded
        return f'{head} offset="{offset}"/>'

    def cells(self, kind, lists):
        ends = np.cumsum([len(one) for one in lists])
        flat = [corner for one in lists for corner in one]
        return f"<{kind}>{self.array('connectivity', flat, 'i8')}{self.array('offsets', ends, 'i4')}</{kind}>"

    def document(self, pieces=1):
        by = f' compressor="{self.compressor}"' if self.compressor else ""
        order = "BigEndian" if self.order == ">" else "LittleEndian"
        header = f'header_type="{"UInt64" if self.word.itemsize == 8 else "UInt32"}"'
        piece = "".join([
            '<Piece><PointData Normals="up" TCoords="place">', self.array("up", NORMALS, "f4"),
            self.array("place", UV, "f4"), self.array("heat", np.arange(7), "f4"),
            self.array("obscurance", np.linspace(0, 1, 7), "f4"), "</PointData><Points>",
            self.array("Points", POINTS, "f4"), "</Points>", self.cells("Verts", []), self.cells("Lines", []),
            self.cells("Strips", STRIPS), self.cells("Polys", POLYGONS), "</Piece>",
        ])  # fmt: skip
        text = f'<?xml version="1.0"?>\n<!-- made -->\n<VTKFile type="PolyData" byte_order="{order}" {header}{by}>'
        text += f"<PolyData>{piece * pieces}</PolyData>"
        if self.appended:
            encoding = self.form.split()[1]
            return (
                f'{text}<AppendedData encoding="{encoding}">\n _'.encode()
                + self.appended
                + b"\n</AppendedData></VTKFile>"
            )
        return f"{text}</VTKFile>".encode()
