"""Ways to spoil a file: bytes, words, and the trees of JSON and TOML."""

import copy
import io
import json
import re
import struct
import sys
import zipfile
import zlib
from contextlib import suppress

import fuzz_seeds

WORDS = [
    b"0", b"-1", b"1", b"7", b"255", b"4294967295", b"4294967296", b"-2147483648", b"9223372036854775808", b"1e308",
    b"-1e308", b"5e-324", b"1e999", b"nan", b"inf", b"-inf", b"0x10", b"1.5", b"99999999999999999999", b"\n", b"\r\n",
    b"\0", b" ", b"\x0c", b"/", b"//", b"\\\n", b"#", b"\xff\xfe", b"\xe2\x80\xa8", b"\xc2\xa0", b"\x1b[31m",
    b"a" * 300, b"1" * 5000, b"element face 3\n", b"element vertex -1\n", b"property list int double x\n",
    b"property uint64 y\n",
    b"property list uint uint vertex_indices\n", b"format binary_big_endian 1.0\n", b"end_header\n", b"f 1 2 3\n",
    b"f 1/1/1 2/2/2 -1/-1/-1\n", b"v 1 2\n", b"vn 0 0 0\n",
    b"endsolid", b"solid x\n", b"vertex 1 2 3\n", b"OFF",
    b"COFF", b'<component objectid="2"/>', b'<item objectid="2"/>',
    b"<!DOCTYPE x [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>",
    b"&a;", b"</mesh>", b'path="/../secret"',
]  # fmt: skip
PATHS = [
    "../secret.bin", "/etc/passwd", "http://127.0.0.1:9/a", "file:///etc/passwd", "link.bin", "out/secret.bin", "..",
    ".", "", "sub/../../secret.bin", "%2e%2e/secret.bin", "m.gltf", "m.toml", "m.bin", "paint.png", "\\\\a\\b", "c:a",
    "C:/a", "a\0b", "sub/quad.glb", "w.npy", "square.obj", "pipe", "~/a", "data:,", "data:;base64,AAAA",
    "data:;base64,%",
]  # fmt: skip
NUMBERS = [-1, 0, 1, 2, 3, 5, 7, 1000, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, 2**64, 10**30, -(2**63), 0.5, -0.0, 1e-9,
           1e-100, 1e100, 1e308, -1e308, 5e-324, float("inf"), float("-inf"), float("nan")]  # fmt: skip
OTHERS = [True, False, None, [], {}, [[]], [0], [0, 0, 0], [1, 2, 3, 4, 5], {"a": 1}, "x", "25%", "inf", "a\nb",
          "\x1b[31m", "\ud800", "é" * 200, "gold", "book", "off", "binary", "sphere", "temple", "lambert"]  # fmt: skip
LONGEST = 1 << 16


def unspoiled():
    """Family, name and bytes of each file that is spoilt."""
    for family, files in fuzz_seeds.seeds().items():
        for name, content in files:
            if not isinstance(content, bytes):
                content = (toml_text(content) if family == "toml" else json.dumps(content)).encode()
            yield family, name, content


def spoiled(family, rng):
    """The name and bytes of a damaged file of a family, by a `random.Random`."""
    usual = sys.getrecursionlimit()
    sys.setrecursionlimit(100_000)  # copies of deeply nested trees
    try:
        return _spoiled(family, rng)
    finally:
        sys.setrecursionlimit(usual)


def _spoiled(family, rng):
    name, content = rng.choice(fuzz_seeds.seeds()[family])
    if family == "glb" and rng.random() < 0.7:
        return name, _glb(content, rng)
    if family == "3mf" and rng.random() < 0.7:
        return name, _archive(content, rng)
    if family == "png" and rng.random() < 0.7:
        return name, _png(content, rng)
    if family == "stl" and rng.random() < 0.5:
        spoilt = damaged(content, rng)
        return name, spoilt[:80] + max((len(spoilt) - 84) // 50, 0).to_bytes(4, "little") + spoilt[84:]
    if isinstance(content, bytes):
        return name, damaged(content, rng)
    tree = mutated(content, rng, toml=family == "toml")
    text = toml_text(tree) if family == "toml" else json.dumps(tree)
    data = text.encode("utf-8", "surrogatepass")[: 4 * LONGEST]
    return name, damaged(data, rng) if rng.random() < 0.15 else data


def damaged(data, rng):
    """Bytes after one to six accidents."""
    for _ in range(rng.choice((1, 1, 2, 3, 6))):
        data = bytes(rng.choice(ACCIDENTS)(bytearray(data), rng))[:LONGEST]
    return data


def _place(data, rng):
    return rng.randrange(len(data) + 1)


def _flip(data, rng):
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return data


def _byte(data, rng):
    if data:
        data[rng.randrange(len(data))] = rng.choice((0, 1, 9, 10, 32, 45, 48, 57, 127, 128, 255))
    return data


def _insert(data, rng):
    at = _place(data, rng)
    data[at:at] = rng.choice(WORDS)
    return data


def _cut(data, rng):
    return data[: _place(data, rng)]


def _drop(data, rng):
    at = _place(data, rng)
    del data[at : at + rng.choice((1, 2, 4, 16, 100))]
    return data


def _repeat(data, rng):
    at = _place(data, rng)
    piece = data[at : at + rng.choice((1, 4, 20, 100))]
    data[at:at] = piece * rng.choice((1, 2, 10, 1000))
    return data


def _move(data, rng):
    at, to = _place(data, rng), _place(data, rng)
    piece = data[at : at + 16]
    data[to : to + len(piece)] = piece
    return data


def _integer(data, rng):
    value = rng.choice((0, 1, 2, 255, 65535, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 62, 0x7FF0000000000000))
    code = rng.choice(("<B", "<H", "<I", ">I", "<I", "<Q", ">H"))
    size = struct.calcsize(code)
    if len(data) >= size:
        at = rng.randrange(len(data) - size + 1)
        if rng.random() < 0.5:
            at -= at % size
        struct.pack_into(code, data, at, value & ((1 << 8 * size) - 1))
    return data


def _word(data, rng):
    """One word, most often a number, becomes another."""
    found = list(re.finditer(rb"[^\s<>\"=/]+", data[:4000]))
    if found:
        match = rng.choice(found)
        data[match.start() : match.end()] = rng.choice(WORDS)
    return data


def _line(data, rng):
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(3):
        case 0:
            lines[a], lines[b] = lines[b], lines[a]
        case 1:
            del lines[a]
        case 2:
            lines[a:a] = [lines[b]] * rng.choice((1, 5, 2000))
    return b"\n".join(lines)


ACCIDENTS = (_flip, _byte, _insert, _cut, _drop, _repeat, _move, _integer, _integer, _word, _word, _word, _line)


def _glb(content, rng):
    size = struct.unpack_from("<I", content, 12)[0]
    header, binary = json.loads(content[20 : 20 + size]), content[28 + size :]
    if rng.random() < 0.2:
        binary = damaged(binary, rng)
    text = json.dumps(mutated(header, rng)).encode()[: 4 * LONGEST]
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _png(content, rng):
    """Damage within the chunks, the checks right."""
    chunks, at = [], 8
    while at < len(content):
        size = int.from_bytes(content[at : at + 4], "big")
        chunks.append([content[at + 4 : at + 8], content[at + 8 : at + 8 + size]])
        at += 12 + size
    for _ in range(rng.choice((1, 2))):
        chosen = rng.choice(chunks)
        if chosen[0] == b"IDAT" and rng.random() < 0.5:
            with suppress(zlib.error):
                chosen[1] = zlib.compress(damaged(zlib.decompress(chosen[1]), rng))
        else:
            chosen[1] = damaged(chosen[1], rng)
    made = content[:8]
    for kind, body in chunks:
        made += len(body).to_bytes(4, "big") + kind + body + zlib.crc32(kind + body).to_bytes(4, "big")
    return made


def _archive(content, rng):
    with zipfile.ZipFile(io.BytesIO(content)) as file:
        members = {name: damaged(file.read(name), rng) for name in file.namelist()}
    return fuzz_seeds.archive(**members)


def mutated(tree, rng, toml=False):
    """A copy of a tree of dicts and lists after one to four changes."""
    tree = copy.deepcopy(tree)
    for _ in range(rng.choice((1, 1, 2, 4))):
        holders = list(_holders(tree))
        holder = rng.choice(holders)
        keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
        key = rng.choice(keys)
        match rng.randrange(8):
            case 0:
                del holder[key]
            case 1 | 2:
                holder[key] = _number(holder[key], rng)
            case 3:
                holder[key] = copy.deepcopy(rng.choice(OTHERS))
            case 4:
                holder[key] = rng.choice(PATHS) if isinstance(holder[key], str) else copy.deepcopy(rng.choice(OTHERS))
            case 5:
                other = rng.choice(holders)
                holder[key] = copy.deepcopy(rng.choice(list(other.values()) if isinstance(other, dict) else other))
            case 6 if isinstance(holder, list):
                holder[key:key] = [copy.deepcopy(holder[key])] * rng.choice((1, 2, 300))
            case 6:
                holder[rng.choice(_names(tree, toml))] = copy.deepcopy(rng.choice((holder[key], rng.choice(NUMBERS))))
            case 7:
                value = holder[key]
                for _ in range(rng.choice((1, 2, 50, 400))):
                    value = [value] if rng.random() < 0.5 else {"a": value}
                holder[key] = value
        if not any(True for _ in _holders(tree)):
            break
    return tree


def _number(value, rng):
    if isinstance(value, int) and rng.random() < 0.4:
        return value + rng.choice((-2, -1, 1, 2, 100))
    return rng.choice(NUMBERS)


def _holders(tree):
    stack = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, dict | list) and node:
            yield node
            stack.extend(node.values() if isinstance(node, dict) else node)


def _names(tree, toml):
    found = {key for holder in _holders(tree) if isinstance(holder, dict) for key in holder}
    extra = {"baked", "height", "focus", "direction", "fineness", "model", "k_a"} if toml else {"sparse", "byteStride"}
    return sorted(found | extra | {"extensions", "uri", "name"})


def toml_text(tree):
    """A tree as TOML, tables inline; what TOML cannot say becomes a text."""
    return "".join(f"{_key(key)} = {_toml(value)}\n" for key, value in tree.items())


def _key(key):
    return json.dumps(key.encode("utf-8", "replace").decode())


def _toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    return _key("none" if value is None else value)
