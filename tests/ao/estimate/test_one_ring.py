from collections import Counter

import numpy as np
import pytest

from obscurance.ao.estimate.one_ring import Neighbours

POINTS = 9000  # of several blocks


def listed(faces):
    """The neighbours of each point in the order in which faces name them, with half the number of faces."""
    rings = [Counter() for _ in range(POINTS)]
    for face in faces.tolist():
        for k, i in enumerate(face):
            for j in (face[(k + 1) % 3], face[(k + 2) % 3]):
                if i >= 0 and j >= 0 and i != j:
                    rings[i][j] += 0.5
    return rings


def one_rings(faces: np.ndarray, normals: np.ndarray, threads: int) -> Neighbours:
    """Of faces of points, −1 for none: that of the first vertex."""
    return Neighbours.of((faces + 1).astype(np.int32), np.arange(-1, POINTS), normals, threads)


@pytest.mark.parametrize("threads", [1, 5])
def test_one_rings_are_those_of_the_edges_of_faces(threads):
    random = np.random.default_rng(3)
    faces = random.integers(-1, POINTS, (12000, 3))
    fan = np.arange(3000)
    faces[: len(fan)] = np.stack([np.zeros(3000, np.int64), fan + 1, fan + 2], axis=1)  # one point has thousands
    faces[5000:5100, 1] = faces[5000:5100, 0]
    faces[6000:6100] = faces[7000:7100]  # doubled faces
    normals = np.tile(np.float32([0, 0, 1]), (POINTS, 1))
    found = one_rings(faces, normals, threads)
    expected = listed(faces)
    assert found.starts[0] == 0
    assert np.array_equal(np.diff(found.starts), [len(ring) for ring in expected])
    assert found.indices.tolist() == [j for ring in expected for j in ring]
    assert found.weights.tolist() == [weight for ring in expected for weight in ring.values()]


def test_one_rings_among_some_points_are_of_these_alone():
    random = np.random.default_rng(5)
    normals = np.tile(np.float32([0, 0, 1]), (POINTS, 1))
    neighbours = one_rings(random.integers(-1, POINTS, (12000, 3)), normals, 2)
    kept = np.flatnonzero(random.random(POINTS) < 0.3)
    kept_set = set(kept.tolist())
    among = neighbours.among(kept)
    rings = [slice(*neighbours.starts[i : i + 2]) for i in kept.tolist()]
    expected = [
        (row, i, weight)
        for row, ring in enumerate(rings)
        for i, weight in zip(neighbours.indices[ring].tolist(), neighbours.weights[ring].tolist(), strict=True)
        if i in kept_set
    ]
    owner = np.repeat(np.arange(len(kept)), np.diff(among.starts))
    listed_among = list(zip(owner.tolist(), kept[among.indices].tolist(), among.weights.tolist(), strict=True))
    assert listed_among == expected
