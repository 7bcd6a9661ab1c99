"""The table of formats and what follows it: names of functions, choices of options, pipes."""

from typing import get_args

import pytest

from scenes.formats.images import ENDINGS as IMAGES
from scenes.formats.table import FORMATS, endings, format_of, function, sniffed_format
from scenes.jobs.options import Format, InputFormat


@pytest.mark.parametrize("row", FORMATS.values(), ids=FORMATS)
def test_functions_of_a_row_are_there(row):
    for name in filter(None, (row.read, row.write, row.lost)):
        assert callable(function(name))
    assert bool(row.read) == bool(row.peak)
    assert not row.lost or row.write


def test_options_offer_the_formats_of_the_table():
    assert {f".{name}" for name in get_args(InputFormat)} == set(endings("read"))
    assert {f".{name}" for name in get_args(Format)} == {*endings("write"), *IMAGES} - {".tiff"}


def test_endings_are_found_in_any_case_and_others_go_to_libraries():
    assert format_of("a/b.PLY") is FORMATS[".ply"]
    assert format_of("mesh.dae").ending == format_of("mesh").ending == ""


@pytest.mark.parametrize(
    ("content", "ending"),
    [
        (b"ply\nformat", ".ply"), (b"glTF\x02", ".glb"), (b' {"asset"', ".gltf"), (b"PK\x03\x04", ".3mf"),
        (b"# a comment\n\nv 0 0 0\n", ".obj"), (b"COFF 3 1 0", ".off"), (b"solid x\n facet normal", ".stl"),
        (b"solid", None), (b"vertex 1", None),
    ],
)  # fmt: skip
def test_first_bytes_show_the_format(content, ending):
    assert sniffed_format(content) == ending
