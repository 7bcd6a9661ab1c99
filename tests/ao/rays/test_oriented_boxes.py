"""Slivers, pages and needles side by side get oriented boxes: every triangle inside, and the same bits as without."""

import math

import numpy as np
import pytest

import ao
from raytrace import Mesh
from raytrace.bvh import bvh16
from raytrace.bvh.bvh16 import BVH16
from raytrace.mesh.placement import Placement
from scenes.geometry.polyhedra import generic_rotation, icosphere, join


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


@pytest.mark.parametrize("falloff", [ao.Binary(), ao.Binary(0.2), ao.Exponential(tau=1.0)], ids=str)
@pytest.mark.parametrize("name", TANGLED)
def test_they_change_no_bit(name, falloff, monkeypatch):
    """Nor does a plate in reach of the others, which is seen past them."""
    plate = np.array([[-3, -3, -0.5], [3, -3, -0.5], [0, 4, -0.4]]), np.array([[0, 1, 2]])
    mesh = Mesh(*join([TANGLED[name], plate]))
    some = np.arange(len(mesh.vertices)) % 36 == 1  # no tip

    def bake(samples):
        return ao.bake(mesh, falloff, samples, only=some, denoise=False, interior="ignore")

    oriented = [bake(samples) for samples in (16, 100)]
    monkeypatch.setattr(bvh16, "orient", lambda triangles, boxes, starts: (boxes, starts, None))
    for found in oriented:
        aligned = bake(16 if found is oriented[0] else 100)
        for column in ("w", "error", "flags", "bent_normals"):
            assert np.array_equal(getattr(found, column), getattr(aligned, column)), column
