"""The OBJ reader against a plain one, line by line, over random files that are wrong here and there."""

import random
import re
from fractions import Fraction

import numpy as np
import pytest

from obscurance.raytrace.errors import MeshError
from obscurance.scenes.formats.number_rows import BLOCK
from obscurance.scenes.formats.obj.text import ObjText

NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf(inity)?|nan(\(\w*\))?)", re.IGNORECASE)
INDEX = re.compile(rb"[+-]?\d+")
STATEMENT = re.compile(rb"[ \t]*(v|vt|vn|f|usemtl)(?=\s|$)([^#]*)")
NEEDED = {b"v": 3, b"vt": 2, b"vn": 3}
NONE = 1 << 62


def numbers(lines, needed):
    """All numbers where all lines have equally many, else the first ones of the lines that have enough."""
    alike = lines and len(lines[0]) >= needed and len(set(map(len, lines))) == 1
    rows = [line[: None if alike else needed] for line in lines if len(line) >= needed]
    for wrong in (word for row in rows for word in row if not NUMBER.fullmatch(word)):
        raise ValueError(f"{wrong.decode('utf-8', 'replace')}, which is no number")
    nan = re.compile(rb"\(.*")
    return np.array([[float(nan.sub(b"", word)) for word in row] for row in rows]).reshape(
        len(rows), -1 if rows else needed
    )


def row_of(line, needed):
    """The numbers that a corner refers to, zeros and False where they are not finite or not numbers."""
    words = line[:needed]
    if len(words) < needed or any(not NUMBER.fullmatch(word) or b"(" in word for word in words):
        return [0.0] * needed, False
    row = [float(word) for word in words]
    return (row, True) if np.isfinite(row).all() else ([0.0] * needed, False)


def per_corner(lines, needed, indices):
    """Both may be missing or wrong at some corners, which have those of a row of NaN."""
    if not any(1 <= index <= len(lines) for index in indices):
        return None
    rows = [row_of(line, needed) for line in lines]
    of = [index - 1 if 1 <= index <= len(lines) and rows[index - 1][1] else len(lines) for index in indices]
    values = [row for row, _ in rows] + [[np.nan] * needed] * (len(lines) in of)
    return np.array(values), np.array(of)


def plain(data):
    """Vertices, colours, sizes, corners, normals, texture coordinates, and the material's name of each face."""
    data = re.sub(rb"\\(\r\n|\r|\n)", b" ", data.removeprefix(b"\xef\xbb\xbf"))
    lines = {keyword: [] for keyword in NEEDED}
    sizes, corners, materials, material, unmatched = [], [], [], None, False
    for line in re.split(rb"[\r\n]", data):
        if not (found := STATEMENT.match(line)):
            continue
        keyword, words = found[1], found[2].split()
        if keyword == b"usemtl":
            material = found[2].strip().decode("utf-8", "replace")
        elif keyword != b"f":
            lines[keyword].append(words)
        else:
            sizes.append(len(words))
            materials.append(material)
            for word in words:
                parts = word.split(b"/")
                unmatched |= any(part and not INDEX.fullmatch(part) for part in parts)
                if not unmatched:
                    large = [max(min(int(part), 2**63 - 1), 1 - 2**63) if part else NONE for part in parts]
                    seen = [len(each) for each in lines.values()]
                    absolute = [i + n + 1 if i < 0 else i for i, n in zip((large + [NONE] * 2)[:3], seen, strict=True)]
                    corners.append(absolute)
    vertices = numbers(lines[b"v"], 3)
    if short := sum(len(words) < 3 for words in lines[b"v"]):
        raise MeshError("m", "v", "three coordinates on every line", f"fewer on {short} of them")
    if unmatched:
        raise ValueError("corners of faces that are no numbers")
    v, vt, vn = np.array(corners, object).reshape(-1, 3).T.tolist()
    if outside := [index for index in v if not 1 <= index <= len(vertices)]:
        raise MeshError("m", "f", f"v indices from 1 to {len(vertices)}", outside[0])
    own = np.array(v, np.int64) - 1
    colors = vertices[:, 3:] if vertices.shape[1] == 6 else None
    return (
        vertices[:, :3], colors, np.array(sizes, np.int64), own,
        per_corner(lines[b"vn"], 3, vn), per_corner(lines[b"vt"], 2, vt), materials,
    )  # fmt: skip


def present(data):
    file = ObjText(data, "m")
    painted = file.named("usemtl")
    materials = [None if of < 0 else painted.names[of] for of in painted.of]
    return file.vertices, file.colors, file.sizes, file.corners, file.normals(), file.uv, materials


def outcome(read, data):
    """What a reader finds, bit by bit, or how it fails."""
    try:
        found = read(data)
    except MeshError as reason:
        return str(reason)
    except ValueError as reason:
        return re.sub(r" in line [\d,]+,", ",", str(reason))

    def frozen(value):
        if isinstance(value, np.ndarray):
            signless = np.where(np.isnan(value), np.nan, value) if value.dtype.kind == "f" else value
            return value.shape, str(value.dtype), np.ascontiguousarray(signless).tobytes()
        return tuple(map(frozen, value)) if isinstance(value, tuple) else value

    return [frozen(each) for each in found]


ODD = [
    "nan",
    "-inf",
    "1e400",
    "1e-320",
    "0." + 25 * "3",
    "9007199254740993",
    "1e",
    "x",
    "1-2",
    "--1",
    ".",
    "1_0",
    "é",
    "nan(7)",
]
ODD_INDICES = ["0", "-9", "99", "a", "1.5", "-", "", "9" * 25, "-" + "9" * 25, "1/2/3/1", "1/2/x", "+1"]


def generate(rng, mistakes):
    """The bytes of an OBJ file; `mistakes`: the part of its words that are odd."""

    def number():
        value = rng.choice([rng.uniform(-9, 9), rng.gauss(0, 1) * 10.0 ** rng.randint(-30, 30), rng.randint(-99, 99)])
        form = rng.choice(["{}", "{!r}", "{:.18e}", "{:.6f}", "{:+.8E}", "{:030.9f}", "{:.0f}."])
        return rng.choice(ODD) if rng.random() < mistakes else form.format(value)

    def index(count):
        odd = rng.random() < mistakes
        return rng.choice(ODD_INDICES) if odd else str(rng.choice([rng.randint(1, count), -rng.randint(1, count)]))

    form = rng.choice(["{0}", "{0}/{1}", "{0}//{2}", "{0}/{1}/{2}", "mixed"])

    def corner():
        own = rng.choice(["{0}", "{0}/", "{0}//", "/{1}", "{0}/{1}", "{0}//{2}"]) if form == "mixed" else form
        return own.format(index(4), index(3), index(2))

    width = rng.choice([3, 3, 4, 6])
    blank = rng.choice([" ", " ", "\t", "  ", " \x0b\x0c "])
    rows = [["v", *(number() for _ in range(width))] for _ in range(4)]
    rows += [["vt", number(), number()] for _ in range(3)] + [["vn", number(), number(), number()] for _ in range(2)]
    for _ in range(rng.randint(1, 8)):
        rows.append(["f", *(corner() for _ in range(rng.choice([3, 3, 3, 4, 7])))])
        more = rng.choice(
            [["usemtl", "a b"], ["usemtl", "b"], ["g", "v 1 2 3"], ["#", "f 1"], ["s", "1"], ["vertex", "1"], []]
        )
        rows += rng.choice([[], [], [more], [["v", *(number() for _ in range(width))]]])
    lines = []
    for row in rows:
        if rng.random() < mistakes:
            row = [*row[: rng.randint(0, 3)], *row[rng.randint(1, 4) :]]
        line = rng.choice(["", "", "", "  ", "\t"]) + blank.join(row) + rng.choice(["", "", " ", "# 1", "#"])
        lines.append(line.replace(blank, " \\\n", 1) if rng.random() < 0.1 else line)
    end = rng.choice(["\n", "\n", "\r\n", "\r", "\n\n \n"])
    content = end.join(lines).replace("\\\n", "\\" + end[-2:].strip(" ") if "\r" in end else "\\\n")
    return rng.choice([b"", b"\xef\xbb\xbf"]) + content.encode() + rng.choice([b"", end.encode()])


@pytest.mark.parametrize("seed", range(6))
def test_against_a_plain_reader(seed):
    rng = random.Random(seed)
    outcomes = []
    for _ in range(100):
        data = generate(rng, rng.choice([0, 0, 0.005, 0.05]))
        if rng.random() < 0.5:  # a block of bytes ends within
            mark = data[: 3 * data.startswith(b"\xef\xbb\xbf")]
            data = mark + b"#" * (BLOCK - rng.randrange(len(data) + 2)) + b"\n" + data[len(mark) :]
        expected = outcome(plain, data)
        assert outcome(present, data) == expected, data
        outcomes.append(isinstance(expected, str))
    assert 10 < sum(outcomes) < 90


def test_numbers_about_midway_between_two_doubles_are_rounded_as_python_rounds_them():
    rng = random.Random(0)
    words = []
    for _ in range(3000):
        midway = Fraction(2 * rng.getrandbits(52) + 2**53 + 1) * Fraction(2) ** rng.randint(-60, 10)
        places = rng.randint(17, 19) - len(str(int(midway))) if midway >= 1 else rng.randint(17, 19)
        digits = int(midway * Fraction(10) ** places)
        words += [f"{digits + step}e{-places}" for step in (0, 1)]
    text = "v " + "\nv ".join(map(" ".join, zip(*[iter(words)] * 3, strict=True)))
    assert ObjText(text.encode(), "m").vertices.ravel().tolist() == list(map(float, words))
