"""The hierarchy of sixteen: every triangle once, inside the boxes above it, beside its neighbours."""

import numpy as np
import pytest

from obscurance.raytrace.bvh.bvh16 import BVH16, median_order
from obscurance.scenes.geometry.polyhedra import icosphere


def soup(faces):
    corners = np.random.default_rng(faces).normal(size=(faces, 3, 3)).astype(np.float32)
    return corners.reshape(-1, 3), np.arange(3 * faces, dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("faces", [1, 16, 17, 300, 5000, 70_000])
def test_a_tree_holds_every_triangle_once_within_its_boxes(faces):
    vertices, corners = soup(faces)
    tree = BVH16.of(vertices, corners)
    leaves = tree.triangles.transpose(0, 2, 1).reshape(-1, 9)
    held = leaves[~np.isnan(leaves[:, 0])]
    assert np.array_equal(np.sort(held, axis=0), np.sort(vertices.reshape(-1, 9), axis=0))
    points = tree.triangles.reshape(-1, 3, 3, 16).transpose(0, 1, 3, 2).reshape(len(tree.triangles), 48, 3)
    low, high = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    for level in range(len(tree.starts) - 1):
        nodes = tree.boxes[tree.starts[level] : tree.starts[level + 1]].transpose(0, 2, 1).reshape(-1, 6)
        boxes = nodes[~np.isnan(nodes[:, 0])]
        assert len(boxes) == len(low)
        assert (boxes[:, :3] - boxes[:, 3:] <= low).all()
        assert (boxes[:, :3] + boxes[:, 3:] >= high).all()
        padded = np.full((-(-len(low) // 16) * 16, 3), np.nan)
        padded[: len(low)], upper = low, padded.copy()
        upper[: len(high)] = high
        low, high = np.nanmin(padded.reshape(-1, 16, 3), axis=1), np.nanmax(upper.reshape(-1, 16, 3), axis=1)
    assert len(low) == 1


def test_no_triangles_make_a_tree_without_any():
    tree = BVH16.of(np.zeros((3, 3), np.float32), np.zeros((0, 3), np.int32))
    assert np.isnan(tree.boxes).all()


@pytest.mark.parametrize("faces", [0, 1, 16, 4096, 5000, 66_000])
def test_an_order_has_every_triangle_once(faces):
    order = median_order(*soup(faces))
    assert np.array_equal(np.sort(order), np.arange(faces))


def test_halves_lie_beside_each_other_down_to_the_parts_of_threads():
    vertices, faces = soup(66_000)
    centroids = vertices[faces[median_order(vertices, faces)]].sum(axis=1)
    parts = [(0, len(faces))]
    for begin, end in parts:
        if end - begin > 4096:
            child = max(16**k for k in range(5) if 16**k < end - begin)
            half = begin + -(-(end - begin) // child) // 2 * child
            axis = np.argmax(np.ptp(centroids[begin:end], axis=0))
            assert centroids[begin:half, axis].max() <= centroids[half:end, axis].min()
            parts += [(begin, half), (half, end)]


def test_sixteen_neighbours_make_a_small_leaf():
    vertices, faces = icosphere(5)  # 20,480 faces of about equal size
    tree = BVH16.of(np.asarray(vertices, np.float32), faces.astype(np.int32))
    sides = np.nanmax(tree.triangles.reshape(-1, 3, 3, 16), axis=(1, 3))
    sides -= np.nanmin(tree.triangles.reshape(-1, 3, 3, 16), axis=(1, 3))
    edge = np.sqrt(16 * 4 * np.pi / len(faces))  # of a square of as much surface
    assert np.median(np.linalg.norm(sides, axis=1)) < 2 * edge
