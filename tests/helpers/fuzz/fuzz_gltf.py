"""glTF files that are wrong in indices, counts, trees and types, written from a right one."""

import copy
import json
import math
import re
import struct

import fuzz_seeds
from fuzz_mutations import mutated


def spoiled(rng):
    header, binary = fuzz_seeds.gltf()
    tree = copy.deepcopy(header)
    for _ in range(rng.choice((1, 1, 2, 3))):
        change = rng.choice((_cycle, _many_nodes, _refer, _refer, _accessor, _accessor, _view, _numbers, None, None))
        if change is None:
            tree = mutated(tree, rng)
        elif change is _numbers:
            binary = _numbers(binary, rng)
        else:
            change(tree, rng)
    text = json.dumps(tree)
    if rng.random() < 0.15:
        text = _twice(text, rng)
    data = text.encode("utf-8", "surrogatepass")
    if rng.random() < 0.4:
        return "m.gltf", data
    buffers = tree.get("buffers")
    if isinstance(buffers, list) and buffers and isinstance(buffers[0], dict) and rng.random() < 0.9:
        buffers[0].pop("uri", None)
        data = json.dumps(tree).encode("utf-8", "surrogatepass")
    chunks = [(b"JSON", data), (b"BIN\0", binary)]
    if rng.random() < 0.1:
        rng.shuffle(chunks)
    if rng.random() < 0.1:
        chunks += [rng.choice(chunks)] * rng.choice((1, 20))
    body = b"".join(struct.pack("<I4s", off(len(content), rng), kind) + content for kind, content in chunks)
    return "m.glb", struct.pack("<4sII", b"glTF", rng.choice((2, 2, 2, 2, 2, 1, 3)), off(12 + len(body), rng)) + body


def off(number, rng):
    """A count as it should be, or one in twenty times another."""
    return number if rng.random() < 0.95 else rng.choice((0, 1, max(number - 4, 0), number + 1, 2**31, 2**32 - 1))


def rows_of(tree, *names):
    """The tables in lists of these names."""
    return [row for name in names if isinstance(tree.get(name), list) for row in tree[name] if isinstance(row, dict)]


def _cycle(tree, rng):
    nodes = rows_of(tree, "nodes")
    if nodes:
        rng.choice(nodes)["children"] = [rng.randrange(len(nodes) + 1) for _ in range(rng.choice((1, 2, 5)))]


def _many_nodes(tree, rng):
    """A chain, or each node twice the child of the one before: 2^n copies."""
    nodes = tree.get("nodes")
    if isinstance(nodes, list):
        depth, first = rng.choice((5, 40, 500, 3000)), len(nodes)
        fan = rng.choice((1, 1, 2))
        nodes += [{"children": [first + n + 1] * fan, "scale": [rng.choice((1, 1.5, 0.5))] * 3} for n in range(depth)]
        nodes.append({"mesh": 0})
        tree["scenes"] = [{"nodes": [0, first]}]


REFERENCES = ("mesh", "camera", "source", "sampler", "bufferView", "buffer", "indices", "material", "index", "skin",
              "light", "texCoord", "scene", "POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "TANGENT", "JOINTS_0",
              "WEIGHTS_0", "inverseBindMatrices")  # fmt: skip


def _refer(tree, rng):
    """An index to another thing, or to none."""
    found = [
        (holder, key) for holder in _tables(tree) for key, value in holder.items() if key in REFERENCES and value != {}
    ]
    if found:
        holder, key = rng.choice(found)
        holder[key] = rng.choice((0, 1, 2, 3, 5, 9, 50, -1, 2**31, 2**63, 1.0, 0.5, "0", None, True, [0], {"index": 0}))


def _tables(tree):
    stack = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, dict):
            yield node
            stack.extend(node.values())
        elif isinstance(node, list):
            stack.extend(node)


SIZES = (0, 1, 2, 3, 4, 5, 7, 8, 11, 12, 16, 36, 100, 252, 256, 1000, 10**6, 2**31, 2**32, 2**40, 2**63, -1, -4, 0.5)


def _accessor(tree, rng):
    accessors = rows_of(tree, "accessors")
    if not accessors:
        return
    row = rng.choice(accessors)
    match rng.randrange(6):
        case 0:
            row["count"] = rng.choice((row.get("count"), *SIZES))
        case 1:
            row["byteOffset"] = rng.choice(SIZES)
        case 2:
            row["componentType"] = rng.choice((5120, 5121, 5122, 5123, 5124, 5125, 5126, 5130, 0, "5126"))
        case 3:
            row["type"] = rng.choice(("SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4", "VEC5", 3))
        case 4:
            row["normalized"] = rng.choice((True, False, 1, "true"))
        case 5:
            row["sparse"] = {
                "count": rng.choice(SIZES),
                "indices": {"bufferView": rng.randrange(4), "componentType": rng.choice((5121, 5123, 5125, 5126))},
                "values": {"bufferView": rng.randrange(4), "byteOffset": rng.choice((0, 1, 4))},
            }
            if rng.random() < 0.5:
                row.pop("bufferView", None)


def _view(tree, rng):
    views = rows_of(tree, "bufferViews", "buffers")
    if views:
        rng.choice(views)[rng.choice(("byteOffset", "byteLength", "byteStride", "target"))] = rng.choice(SIZES)


def _numbers(binary, rng):
    """Coordinates or indices within the arrays."""
    data = bytearray(binary)
    code, values = rng.choice(
        (("<f", (math.nan, math.inf, 1e38, -3e38, 1e-45, 1e20, 0.0)), ("<H", (65535, 9)), ("<B", (255, 9)))
    )
    size = struct.calcsize(code)
    for _ in range(rng.choice((1, 1, 3, 50))):
        struct.pack_into(code, data, rng.randrange(len(data) // size) * size, rng.choice(values))
    return bytes(data)


def _twice(text, rng):
    """A key given twice."""
    found = list(re.finditer(r'"(\w+)": ("\w*"|[\d.-]+)', text))
    if not found:
        return text
    pair = rng.choice(found)
    value = rng.choice((pair[2], "9", "null", "1e999", "NaN", "-1", '"x"', "[]", "{}", "1" * 5000))
    return f'{text[: pair.end()]}, "{pair[1]}": {value}{text[pair.end() :]}'
