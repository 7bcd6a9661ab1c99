"""What a page holds, decoded as its script does it."""

import base64
import gzip
import json
import re

import numpy as np

CODES = {1: np.uint8, 2: np.uint16, 4: np.uint32}


def facts_of(page):
    """What the page's script is given."""
    return json.loads(re.search(rb'<script type="application/json" id="about">(.*?)</script>', page, re.DOTALL)[1])


def columns_of(page):
    """The arrays of the page by their names, whole numbers as stored."""
    packed = re.search(rb'<script type="text/plain" id="data">(.*?)</script>', page, re.DOTALL)[1]
    data, start, found = gzip.decompress(base64.b64decode(packed)), 0, {}
    for name, size, count in facts_of(page)["columns"]:
        planes = np.frombuffer(data, np.uint8, size * count, start).reshape(size, count).astype(np.uint32)
        found[name] = sum(plane << 8 * number for number, plane in enumerate(planes)).astype(CODES[size])
        start += size * count
    assert start == len(data)
    return found


def faces_of(columns):
    """Faces (m, 3), sorted."""
    least, *above = columns["faces"].reshape(3, -1).astype(np.int64)
    least = np.cumsum(least)
    return np.stack([least, *(least + each for each in above)], axis=1)


def vectors_of(stored, most):
    """Unit vectors (n, 3), zero where there is none."""
    whole = stored.reshape(2, -1).astype(float)
    x, y = 2 * (whole - 1) / (most - 1) - 1
    z = 1 - abs(x) - abs(y)
    folded = np.where(z < 0, [(1 - abs(y)) * np.copysign(1, x), (1 - abs(x)) * np.copysign(1, y)], [x, y])
    vectors = np.stack([*folded, z], axis=1)
    return np.where(whole[0][:, None] > 0, vectors / np.linalg.norm(vectors, axis=1, keepdims=True), 0)
