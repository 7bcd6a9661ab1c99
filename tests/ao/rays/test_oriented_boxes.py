"""Slivers, pages and needles side by side get oriented boxes: every triangle inside, and the same bits as without."""

import math
from itertools import pairwise

import numpy as np
import pytest

from obscurance import ao
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.rays.directions import DirectionTable
from obscurance.ao.rays.gather import COLUMNS, W, gather_hemispheres
from obscurance.ao.rays.ray_blocks import Rays
from obscurance.ao.rays.traverse import TraversalState
from obscurance.raytrace import Mesh
from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.mesh.placement import Placement
from obscurance.scenes.geometry.polyhedra import generic_rotation, icosphere, join


def around(count):
    angle = 2 * math.pi * np.arange(count) / count
    return np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])


def loose(corners):
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def cone(count):
    row = np.arange(count)
    return np.vstack([around(count), [[0, 0, 1.0]]]), np.column_stack([row, (row + 1) % count, np.full(count, count)])


def pages(count):
    ends = np.zeros((count, 3)), around(count) + np.array([0, 0, 0.5]), np.tile([0, 0, 1.0], (count, 1))
    return loose(np.stack(ends, axis=1))


def needles(count):
    rng = np.random.default_rng(1)
    tip = rng.normal(size=(count, 3))
    tip /= np.linalg.norm(tip, axis=1, keepdims=True)
    aside = np.cross(tip, rng.normal(size=(count, 3))) * 0.1 / math.sqrt(count)
    return loose(np.stack([np.zeros((count, 3)), tip - aside, tip + aside], axis=1))


def soup(count):
    return loose(np.random.default_rng(2).uniform(-1, 1, (count, 3, 3)))


TANGLED = {"cone": cone(3000), "pages": pages(1500), "needles": needles(2500)}


def tree_of(part):
    mesh = Mesh(*part)
    return BVH16.of(Placement.of(mesh).vertices, mesh.faces)


def in_aligned_boxes(tree):
    """The same leaves in boxes along the axes of space."""
    corners = tree.triangles.astype(np.float64).reshape(len(tree.triangles), 3, 3, 16)
    low, high = np.nanmin(corners, axis=(1, 3)), np.nanmax(corners, axis=(1, 3))
    boxes = aligned(tree.boxes.shape, np.float32)
    for begin, end in pairwise(tree.starts):
        room = np.full((2, 16 * (end - begin), 3), np.nan)
        room[:, : len(low)] = low, high
        low, high = room.reshape(2, end - begin, 16, 3).transpose(0, 1, 3, 2)
        boxes[begin:end] = np.concatenate([(low + high) / 2, (high - low) / 2 + 1e-6], axis=1)
        low, high = np.nanmin(low, axis=2), np.nanmax(high, axis=2)
    return tree._replace(boxes=boxes, axes=None)


@pytest.mark.parametrize("part", [icosphere(4), soup(3000), soup(20)], ids=["ball", "soup", "few"])
def test_boxes_are_aligned_where_others_are_no_better(part):
    assert tree_of(part).axes is None


@pytest.mark.parametrize("name", TANGLED)
def test_oriented_boxes_hold_their_triangles_at_every_level(name):
    vertices, faces = TANGLED[name]
    tree = tree_of((generic_rotation(3).apply(vertices), faces))
    assert tree.axes is not None
    leaves = len(tree.triangles)
    corners = tree.triangles.astype(np.float64).reshape(leaves, 3, 3, 16).transpose(0, 1, 3, 2).reshape(leaves, 48, 3)
    for level in range(len(tree.starts) - 1):
        child = np.arange(leaves) // 16**level
        node, lane = tree.starts[level] + child // 16, child % 16
        centre, half = tree.boxes[node, :3, lane].astype(np.float64), tree.boxes[node, 3:, lane]
        axes = tree.axes[node, :, lane].reshape(-1, 3, 3).astype(np.float64)
        assert np.allclose(axes @ axes.transpose(0, 2, 1), np.eye(3), atol=1e-6)
        away = np.abs(np.einsum("kij,kpj->kpi", axes, corners - centre[:, None]))
        assert (np.isnan(away) | (away <= half[:, None])).all()


@pytest.mark.parametrize("falloff", [ao.Binary(), ao.Binary(0.7), ao.Exponential(tau=1.0)], ids=str)
@pytest.mark.parametrize("name", TANGLED)
def test_they_change_no_bit(name, falloff):
    """Nor does a plate in reach of the others, which is seen past them."""
    plate = np.array([[-3, -3, -0.5], [3, -3, -0.5], [0, 4, -0.4]]), np.array([[0, 1, 2]])
    vertices, faces = join([TANGLED[name], plate])
    mesh = Mesh(generic_rotation(3).apply(vertices), faces)
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    points = receivers.points[np.flatnonzero(np.arange(len(receivers.points)) % 12 == 1)]  # no tip
    mu = falloff.resolve(mesh.radius).in_render_space(placement.scale)
    t_max = min(mu.limit, placement.diagonal)
    in_turned_boxes = receivers.hierarchy.tree
    assert in_turned_boxes.axes is not None
    for samples in (16, 100):
        table = DirectionTable.make(samples, len(points), np.uint32(7))
        oriented, in_aligned = np.empty((2, len(points), 1, COLUMNS))
        for tree, out in ((in_turned_boxes, oriented), (in_aligned_boxes(in_turned_boxes), in_aligned)):
            gather_hemispheres(tree, Rays.of(table), TraversalState.of(tree), points.arrays, table, mu, t_max, out)
        assert oriented[..., W].min() < oriented[..., W].max()
        assert np.array_equal(oriented, in_aligned)
