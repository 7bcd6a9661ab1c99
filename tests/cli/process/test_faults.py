"""A fault of the program itself, after the rays are traced, ends in one line."""

import pytest
from command import obscurance, refused, succeeded

SHEET = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
LAYOUT = "vt 0 0\nvt .4 0\nvt .4 .4\nvt .6 .6\nvt .9 .9\nvt .6 .9\nf 1/1 2/2 3/3\nf 1/4 3/5 4/6\n"


@pytest.mark.parametrize(
    "place", ["obscurance.ao.texture.seams.Seams.close", "obscurance.ao.texture.result.fill_holes"]
)
def test_a_fault_after_the_rays_is_one_line_and_no_file(place, tmp_path, monkeypatch):
    def fail(*_arguments):
        raise IndexError("index 185 is\nout of bounds")

    mesh, page = tmp_path / "sheet.obj", tmp_path / "page.png"
    mesh.write_text(SHEET + LAYOUT)
    monkeypatch.setattr(place, fail)
    words = "IndexError: index 185 is out of bounds (cli/process/test_faults.py, line", "no file is half-written"
    refused(obscurance("bake", mesh, "-o", page, "--size", "16"), *words, status=1)
    assert [path.name for path in tmp_path.iterdir()] == [mesh.name]
    monkeypatch.undo()
    succeeded("bake", mesh, "-o", page, "--size", "16")
    assert page.exists()
