"""VTK files of polygons, as VTK and ParaView write them: arrays as text, in base64, appended and compressed."""

import zlib
from base64 import b64encode

import numpy as np
import pytest
from command import obscurance, refused
from mesh_files import mistake
from vtp_files import COMPRESSORS, FACES, FORMS, NORMALS, POINTS, UV, Writer

from obscurance.scenes.formats.load import load


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("compressor", COMPRESSORS)
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("word", ["u4", "u8"])
def test_every_form_gives_the_same_mesh(tmp_path, form, compressor, order, word):
    (tmp_path / "m.vtp").write_bytes(Writer(form, compressor, order, word).document())
    file = load(tmp_path / "m.vtp", "x.glb")
    np.testing.assert_array_equal(file.mesh.vertices, POINTS)
    np.testing.assert_array_equal(file.mesh.normals, NORMALS)
    assert file.mesh.faces.tolist() == FACES
    np.testing.assert_allclose(file.w, np.linspace(0, 1, 7), atol=1e-7)
    np.testing.assert_array_equal(file.uv, UV[FACES])
    assert (file.sizes.tolist(), file.unread) == ([4, 3, 3, 3, 3], ("heat of points",))


def test_pieces_are_objects_and_pipes_are_known(tmp_path, standard_input):
    (tmp_path / "m.vtp").write_bytes(Writer("binary").document(2))
    assert load(tmp_path / "m.vtp").objects == ("m[0]", "m[1]")
    standard_input(Writer("appended raw", "vtkZLibDataCompressor").document())
    assert "6, 0 of them degenerate" in obscurance("info", "-").stdout


PACKED = Writer("binary", "vtkZLibDataCompressor").document()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (PACKED.replace(b"ZLib", b"LZ4"), "compressor: expected vtkZLibDataCompressor or vtkLZMADataCompressor"),
        (PACKED.replace(b'"PolyData"', b'"UnstructuredGrid"'), "expected a VTKFile of PolyData, got UnstructuredGrid"),
        (PACKED.replace(b"<!--", b"<!DOCTYPE x><!--"), "expected no document type"),
        (PACKED[:-40], "complete and valid VTP file"),
        (PACKED.replace(b"Float32", b"Object"), "complete and valid VTP file"),
        (PACKED.replace(b'"offsets"', b'"onsets"'), "no 'offsets'"),
        (Writer("ascii").document().replace(b"4 6 9", b"4 2 9"), "offsets of polygons"),
        (
            Writer("ascii").document().replace(b"0.5 0.25 0.75 0.0", b"0.5 0.25"),
            "columns of points that are not one row",
        ),
        (Writer("ascii").document().replace(b" 0.0 1.0", b" x 1.0", 1), "complete and valid VTP file"),
        (Writer("appended raw").document().replace(b"</VTKFile>", b""), ""),
    ],
)
def test_malformed_files_end_in_one_line(tmp_path, data, words):
    (tmp_path / "m.vtp").write_bytes(data)
    done = obscurance("info", tmp_path / "m.vtp")
    if words:
        refused(done, "m.vtp", words)
    else:  # what is behind appended data is not looked at
        assert done.returncode == 0


def test_blocks_that_would_fill_the_memory_are_refused(tmp_path):
    content = np.array([1, 1 << 30, 0, 30], "<u4").tobytes() + zlib.compress(bytes(100))
    array = (
        f'<DataArray type="Float32" NumberOfComponents="3" format="binary">{b64encode(content).decode()}</DataArray>'
    )
    text = f'<VTKFile type="PolyData" compressor="vtkZLibDataCompressor"><PolyData><Piece><Points>{array}'
    text += "</Points></Piece></PolyData></VTKFile>"
    assert "blocks larger than what their bytes can hold" in mistake(tmp_path, "m.vtp", text.encode())
