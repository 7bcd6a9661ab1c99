"""The readers of ASCII PLY and OFF against a plain one, over random files, wrong here and there."""

import random

import numpy as np
import pytest
from mesh_files import mistake

from obscurance.raytrace.errors import MeshError
from obscurance.scenes.formats.load import read_asset
from obscurance.scenes.formats.number_rows import BLOCK


def number(rng):
    return rng.choice(
        [str(rng.randint(-9, 9)), repr(rng.uniform(-2, 2)), f"{rng.uniform(-1, 1):.3e}", f"{rng.getrandbits(70)}",
         repr(rng.random() * 10 ** rng.randint(-300, 300)), ".5", "1.", "nan", "Inf"]
    )  # fmt: skip


def generate(rng, mistakes):
    """A file's name, head and lines, and its numbers of vertices, their columns, faces, and columns of these."""
    width, more = rng.choice([3, 3, 4, 6]), rng.choice([0, 0, 3])
    vertices = [[number(rng) for _ in range(width)] for _ in range(rng.randint(1, 7))]
    vertices[0][0] = "1e200"  # no area, so that polygons become fans
    faces = []
    for _ in range(rng.randint(1, 6)):
        size = rng.choice([3, 3, 4, 5])
        faces.append([str(size), *(str(rng.randrange(9)) for _ in range(size)), *(number(rng) for _ in range(more))])
    is_off, end, blank = rng.random() < 0.5, rng.choice(["\n", "\n", "\r\n", "\r"]), rng.choice([" ", " ", "\t", "  "])
    lines = []
    for row in vertices + faces:
        if rng.random() < mistakes:
            row = rng.choice([row[:-1], [*row, "1"], [*row[:-1], "x"], [], [*row[1:], "-1.5"]])
        comment = rng.choice(["# 1", "#"]) if is_off and rng.random() < 0.2 else ""
        lines += [rng.choice(["", "", " "]) + blank.join(row) + rng.choice(["", "", " "]) + comment]
        lines += rng.choice([[], [], [""], ["  "]])
    content, counts = end.join(lines) + rng.choice(["", end]), (len(vertices), width, len(faces), more)
    if is_off:
        head = rng.choice(["OFF\n", "# OFF\n COFF # \n", "STOFF "]) + f"{len(vertices)} {len(faces)} 7{end}"
        return "m.off", head, content, counts
    columns = "".join(f"property float {name}\n" for name in "xyzabc"[:width])
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n{columns}element face {len(faces)}\n"
    colours = "".join(f"property float {name}\n" for name in "rgb"[:more])
    return "m.ply", f"{head}property list uchar int vertex_indices\n{colours}end_header\n", content, counts


def plain(name, content, vertices, width, faces, more):
    """Coordinates, as bytes, and polygons, or None: not all lines are as they should be."""
    lines = [line.partition("#")[0].split() for line in content.splitlines()]
    rows = [line for line in lines if line]
    try:
        if name == "m.ply":
            lengths = [width] * vertices + [1 + float(row[0]) + more for row in rows[vertices:]]
            if len(rows) != vertices + faces or [len(list(map(float, row))) for row in rows] != lengths:
                return None
        points = np.array([list(map(float, row[:3])) for row in rows[:vertices]]).reshape(-1, 3)
        rows = rows[vertices : vertices + faces]
        polygons = [[int(word) for word in row[1 : 1 + int(row[0])]] for row in rows]
    except ValueError:
        return None
    is_whole = len(rows) == faces and all(len(own) == int(row[0]) for own, row in zip(polygons, rows, strict=True))
    is_whole &= all(abs(index) < 1 << 63 for polygon in polygons for index in polygon)
    return (points.tobytes(), polygons) if is_whole else None


@pytest.mark.parametrize("seed", range(4))
def test_against_a_plain_reader(tmp_path, seed):
    rng, refused, corners = random.Random(seed), 0, []
    for _ in range(100):
        name, head, content, counts = generate(rng, rng.choice([0, 0, 0.02, 0.1]))
        if rng.random() < 0.5:  # a block of bytes ends within
            content = " " * (BLOCK - rng.randrange(len(content) + 2)) + "\n" + content
        expected, data = plain(name, content, *counts), (head + content).encode()
        try:
            made = read_asset(tmp_path / name, content=data).primitives[0]
        except MeshError:
            assert expected is None, data
            refused += 1
            continue
        assert expected is not None, data
        fans = [[polygon[0], *polygon[k : k + 2]] for polygon in expected[1] for k in range(1, len(polygon) - 1)]
        assert made.positions.astype(float).tobytes() == expected[0], data
        assert made.faces.tolist() == fans, data
        corners += fans
    assert 5 < refused < 60
    assert len(corners) > 200


def test_lines_of_fewer_numbers(tmp_path):
    off = b"OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n"
    assert mistake(tmp_path, "m.off", off).endswith("3 vertices and 1 faces, got lines of fewer numbers")
    assert "3 vertices and 1 faces, got an end before that" in mistake(tmp_path, "m.off", off[:-9])


@pytest.mark.parametrize(
    ("old", "new"),
    [(b"endsolid a", b""), (b"solid a", b""), (b"endsolid a", b"endsolid a\nvertex 0 0 1"), (b"0 1 0", b"0 1"),
     (b"0 1 0", b"0 1 0 0"), (b"0 1 0", b"0 x 0"), (b"endsolid a", b"solid b\nendsolid b\nendsolid a")],
)  # fmt: skip
def test_lines_of_an_stl_out_of_order(tmp_path, old, new):
    stl = b"SOLID a\n facet normal 0 0 0\nvertex 0 0 0\n\tVertex 1 0 0\r\nvertex 0 1 0\nendsolid a"
    assert len(read_asset(tmp_path / "m.stl", content=stl).mesh.faces) == 1
    assert "STL" in mistake(tmp_path, "m.stl", stl.replace(old, new, 1))
