"""PLY, OFF, OBJ and STL files that are wrong in counts, types, lists, indices, keywords and lines."""

import math
import struct
from functools import cache

from fuzz_gltf import off

WORDS = ["nan", "inf", "-inf", "1e308", "-1e308", "5e-324", "1e999", "1e38", "1e20", "-0", "0x10", "1.5", "", "abc",
         "1e", "--1", "9" * 20, "-1", "4294967295", "2147483648", "1_0", "\u0663", "9" * 4000]  # fmt: skip
TIMES = (2, 3, 10, 300, 3000)


@cache
def ball(rings):
    """A bumpy ball of quadrilaterals and triangles, as corners and polygons."""
    turns = 2 * rings
    angles = [
        (math.pi * (ring + 0.5) / rings, 2 * math.pi * turn / turns) for ring in range(rings) for turn in range(turns)
    ]
    corners = [(math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), 1.2 * math.cos(a)) for a, b in angles]
    polygons = []
    for ring in range(rings - 1):
        for turn in range(turns):
            a, b = ring * turns + turn, ring * turns + (turn + 1) % turns
            quad = [a, a + turns, b + turns, b]
            polygons += [quad] if (ring + turn) % 2 else [quad[:3], [quad[0], *quad[2:]]]
    return corners, polygons


def spoiled(rng):
    corners, polygons = (list(map(list, part)) for part in ball(rng.choice((2, 3, 5))))
    accidents = rng.choice((0, 1, 1, 2, 4))
    for _ in range(accidents):
        match rng.randrange(7):
            case 0:
                rng.choice(corners)[rng.randrange(3)] = rng.choice((math.nan, math.inf, 1e308, 1e30, 1e-320, 1e6, 0))
            case 1:
                rng.choice([each for each in polygons if each])[0] = rng.choice(
                    (-1, len(corners), len(corners) - 1, 0, 2**31, 2**32, 10**30)
                )
            case 2:
                polygons.append([rng.randrange(len(corners)) for _ in range(rng.choice((0, 1, 2, 3, 4, 9, 255, 300)))])
            case 3:
                polygons += [rng.choice(polygons)] * rng.choice(TIMES)
            case 4:
                del polygons[rng.randrange(len(polygons)) :]
            case 5:
                scale = rng.choice((1e-300, 1e-40, 1e-6, 1e6, 1e18, 1e38, 1e150))
                corners = [[scale * x for x in corner] for corner in corners]
            case 6:
                corners = [[x * (rng.random() < 0.5), y, z * (rng.random() < 0.8)] for x, y, z in corners]
        polygons = polygons or [[0, 1, 2]]
    name, make = rng.choice(
        (("m.ply", _ply), ("m.ply", _ply), ("m.off", _off_file), ("m.obj", write_obj), ("m.stl", _stl))
    )
    return name, make(corners, polygons, rng)


KINDS = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
         "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
         "float64": "d"}  # fmt: skip


def _packed(order, kind, value):
    """The value as this type holds it, whatever is lost."""
    code = KINDS.get(kind, "i")
    if code in "fd":
        try:
            return struct.pack(order + code, value)
        except OverflowError:
            return struct.pack(order + code, math.copysign(math.inf, value))
    size = struct.calcsize(code)
    whole = int(value) if math.isfinite(value) else 0
    return (whole & ((1 << 8 * size) - 1)).to_bytes(size, "little" if order == "<" else "big")


def _ply(corners, polygons, rng):
    kind = rng.choice(("float", "double", "float32", *KINDS)) if rng.random() < 0.5 else "double"
    names = ["x", "y", "z", *rng.choice(([], ["nx", "ny", "nz"], ["s", "t"], ["obscurance"], ["red", "green", "blue"]))]
    count, index = (rng.choice(("uchar", "int", "uint", *KINDS)), rng.choice(("int", "uint", *KINDS)))
    if rng.random() < 0.6:
        count, index = "uchar", "int"
    listed = rng.choice(("vertex_indices", "vertex_indices", "vertex_indices", "vertex_index", "indices"))
    form = rng.choice(("ascii", "binary_little_endian", "binary_big_endian"))
    lines = [f"element vertex {_count(len(corners), rng)}", *(f"property {kind} {name}" for name in names)]
    lines += [f"element face {_count(len(polygons), rng)}", f"property list {count} {index} {listed}"]
    extra = rng.random() < 0.2
    if extra:
        lines.append(f"property list uchar float {rng.choice(('texcoord', 'weights', listed))}")
    lines.insert(0, f"format {form} 1.0")
    for _ in range(rng.choice((0, 0, 0, 1, 2))):
        lines = wrong_lines(
            lines,
            rng,
            (
                "property float w",
                "element edge 3",
                "comment x",
                "obj_info " + "y" * 5000,
                "property list uchar list int a",
                "property list int int b",
                "end_header",
                "",
                "element face 2",
                "format ascii 1.0",
                "element vertex 9" * 9,
                "property x",
            ),
        )
    head = "\n".join(["ply", *lines, "end_header", ""]).encode()
    rows = [[*corner, *[rng.choice((0.5, 1, 200, -1))] * (len(names) - 3)] for corner in corners]
    if form == "ascii":
        text = [" ".join(map(_text_of, row)) for row in rows]
        text += [" ".join(map(str, [len(each), *each, *([2, 0.5, 0.5] if extra else [])])) for each in polygons]
        return head + "\n".join([*_damaged_lines(text, rng), ""]).encode("utf-8", "replace")
    order = "<" if "little" in form else ">"
    data = b"".join(_packed(order, kind, value) for row in rows for value in row)
    for each in polygons:
        length = off(len(each), rng) if rng.random() < 0.05 else len(each)
        data += _packed(order, count, length) + b"".join(_packed(order, index, value) for value in each)
        data += b"\2" + struct.pack(order + "2f", 0.5, 0.5) if extra else b""
    return head + (data if rng.random() < 0.9 else data[: rng.randrange(len(data) + 1)])


def _count(number, rng):
    return number if rng.random() < 0.85 else rng.choice((0, 1, number - 1, number + 1, 10**6, 2**31, 10**18, -1, "x"))


def _text_of(value):
    return repr(float(value))


def wrong_lines(lines, rng, others=()):
    """A line that is missing, doubled, moved, long, or another."""
    lines = list(lines)
    at = rng.randrange(len(lines))
    match rng.randrange(6):
        case 0:
            del lines[at]
        case 1:
            lines[at:at] = [lines[at]] * rng.choice(TIMES)
        case 2:
            lines.insert(rng.randrange(len(lines)), lines.pop(at))
        case 3:
            lines.insert(at, rng.choice(others or ("", "#", " ", "\t\\", "\0", "1 2 3")))
        case 4:
            lines[at] += rng.choice((" ", " 0", "\\", " #", "\r", "\0", " " + lines[at])) * rng.choice(TIMES)
        case 5:
            words = lines[at].split(" ")
            words[rng.randrange(len(words))] = rng.choice(WORDS)
            lines[at] = " ".join(words)
    return lines or [""]


def _damaged_lines(lines, rng):
    for _ in range(rng.choice((0, 0, 1, 2))):
        lines = wrong_lines(lines or [""], rng)
    return lines


def _off_file(corners, polygons, rng):
    word = rng.choice(("OFF", "OFF", "OFF", "COFF", "NOFF", "STOFF", "4OFF", "nOFF", "OFF BINARY", "off", ""))
    counts = " ".join(str(_count(number, rng)) for number in (len(corners), len(polygons), 0))
    rows = [" ".join(map(_text_of, corner)) + rng.choice(("", "", " 255 0 0")) for corner in corners]
    rows += [" ".join(map(str, [off(len(each), rng), *each])) + rng.choice(("", "", " .5 .5 1")) for each in polygons]
    return "\n".join(_damaged_lines([word, counts, *rows, ""], rng)).encode("utf-8", "replace")


def write_obj(corners, polygons, rng):
    textured, shaded = rng.random() < 0.4, rng.random() < 0.4
    rows = ["mtllib square.mtl", "o one", *(f"v {' '.join(map(_text_of, corner))}" for corner in corners)]
    rows += [f"vt {rng.choice((0, 0.5, 1, 7))} {rng.choice((0, 0.25, 'nan'))}" for _ in range(4) if textured]
    rows += ["vn 0 0 1", "vn 0 1 0"] if shaded else []
    for number, each in enumerate(polygons):
        if number % 20 == 19:
            rows.append(rng.choice(("usemtl paint", "g b", "s off", "o two", "usemtl none", "# x", "mtllib a b c.mtl")))
        words = []
        for index in each:
            word = str(index + 1 if rng.random() < 0.98 else rng.choice((0, -1, -len(corners), -len(corners) - 1, 1)))
            vt = rng.choice((1, 2, 4, -1)) if textured else ""
            words.append(f"{word}/{vt}/{rng.choice((1, 2, -1))}" if shaded else f"{word}/{vt}" if textured else word)
        rows.append(" ".join([rng.choice(("f",) * 30 + ("l", "p", "fo", "F")), *words]))
    others = (
        "vp 1",
        "curv 0 1",
        "f",
        "f 1",
        "f 1 2",
        "v",
        "v 1 2",
        "vt",
        "vn",
        "f 1 2 \\",
        "mtllib",
        "usemtl",
        "mtllib " + "a " * 3000,
        "g " + "b " * 3000,
        "o " + "c" * 90_000,
        "call x.obj",
        "v 1 2 3 4 5 6 7 8",
    )
    for _ in range(rng.choice((0, 0, 1, 2))):
        rows = wrong_lines(rows, rng, others)
    return "\n".join([*rows, ""]).encode("utf-8", "replace")


def _stl(corners, polygons, rng):
    triangles = [[corners[index] if 0 <= index < len(corners) else [index] * 3 for index in each] for each in polygons]
    if rng.random() < 0.5:
        data = b"".join(
            bytes(12) + b"".join(_packed("<", "float", value) for corner in each[:3] for value in corner) + b"\0\0"
            for each in triangles
            if len(each) > 2
        )
        count = _count(len(data) // 50, rng)
        start = rng.choice((bytes(80), b"solid".ljust(80), b"COLOR=".ljust(80, b"\xff")))
        return start + (count if isinstance(count, int) else 7).to_bytes(9, "little", signed=True)[:4] + data
    rows = ["solid a"]
    for each in triangles:
        rows += ["facet normal 0 0 1", "outer loop", *(f"vertex {' '.join(map(_text_of, corner))}" for corner in each)]
        rows += ["endloop", "endfacet"]
    others = ("endsolid", "solid b", "solid", "vertex", "vertex 1 2", "facet", "endloop", "endfacet", "outer loop")
    for _ in range(rng.choice((0, 1, 1, 3))):
        rows = wrong_lines([*rows, "endsolid a"], rng, others)
    return "\n".join([*rows, ""]).encode("utf-8", "replace")
