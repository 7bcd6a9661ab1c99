"""Cells of points against slow code: what they hold, which touch, and the same on any number of threads."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import hills

from obscurance.ao.estimate.cells import Cells, around
from obscurance.ao.estimate.one_ring import Neighbours
from obscurance.ao.estimate.sites import PREDICTED, SEVERAL_PLACES, Sites
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement

MESH = Mesh(*hills(90))


def graph(threads: int) -> Neighbours:
    receivers = find_receivers(MESH, Placement.of(MESH))
    return Neighbours.of(receivers.faces, receivers.of_vertex, receivers.points.normals, threads)


def rings(neighbours: Neighbours) -> list[set[int]]:
    parts = np.split(neighbours.indices, neighbours.starts[1:-1])
    return [set(part.tolist()) for part in parts]


@pytest.fixture(scope="module")
def cells() -> Cells:
    return Cells.about_four(graph(1))


def test_points_around_others_are_the_nearest() -> None:
    neighbours = graph(1)
    ringed = rings(neighbours)
    centres = np.array([40, 4000, 4040])
    nearest = around(neighbours, centres, 500)
    within, reached = [], set(centres.tolist())
    while len(reached) < len(nearest):
        within = sorted(reached)
        reached |= {j for i in within for j in ringed[i]}
    assert 500 <= len(nearest) < 510
    assert set(within) <= set(nearest.tolist()) <= reached
    assert (np.diff(nearest) > 0).all()


def test_every_point_is_in_the_cell_of_a_nearest_centre(cells: Cells) -> None:
    around = rings(graph(1))
    away = np.where(np.isin(np.arange(len(around)), cells.centres), 0, 99)
    for step in range(1, 5):
        for i in np.flatnonzero(away == 99).tolist():
            if any(away[j] == step - 1 for j in around[i]):
                away[i] = step
    for i in np.flatnonzero(away > 0).tolist():
        before = [j for j in around[i] if away[j] == away[i] - 1]
        assert cells.cell[i] in {cells.cell[j] for j in before}
    assert (cells.cell[cells.centres] == np.arange(len(cells.centres))).all()
    assert 3.5 < len(cells.cell) / len(cells.centres) <= 4


def test_members_are_the_points_of_a_cell(cells: Cells) -> None:
    for number, part in enumerate(np.split(cells.members, cells.starts[1:-1])):
        np.testing.assert_array_equal(part, np.flatnonzero(cells.cell == number))


def test_cells_are_neighbours_where_points_of_theirs_are(cells: Cells) -> None:
    joined = rings(cells.joined(graph(1), np.tile(np.float32([0, 0, 1]), (len(cells.centres), 1))))
    expected = [set[int]() for _ in joined]
    for i, ring in enumerate(rings(graph(1))):
        expected[cells.cell[i]] |= {int(cells.cell[j]) for j in ring} - {int(cells.cell[i])}
    assert joined == expected


def test_any_number_of_threads_makes_the_same_cells(cells: Cells) -> None:
    other = graph(3)
    again = Cells.about_four(other)
    for one, two in zip(cells, again, strict=True):
        np.testing.assert_array_equal(one, two)
    normals = np.tile(np.float32([0, 0, 1]), (len(cells.centres), 1))
    for one, two in zip(cells.joined(graph(1), normals).ring, again.joined(other, normals).ring, strict=True):
        np.testing.assert_array_equal(one, two)


def test_what_is_predicted_errs_by_more_where_neighbours_are_unlike(cells: Cells) -> None:
    """Beside a centre whose w is 1 where all others have 0."""
    own = cells.centres[cells.cell].astype(np.int64)
    predicted = own != np.arange(len(own))
    points = find_receivers(MESH, Placement.of(MESH)).points
    kinds = np.where(predicted, PREDICTED, SEVERAL_PLACES).astype(np.uint8)
    sites = Sites(points, lambda: graph(1), kinds, own)
    w = (np.arange(len(cells.centres)) == 500).astype(np.float64)
    errors = sites.errors_at_all(np.full(len(w), 0.01), w)
    alike = sites.graph.means(w.astype(np.float32), 0.0)[cells.cell] == w[cells.cell]
    assert (errors[alike | ~predicted] == 0.01).all()
    assert (errors[(cells.cell == 500) & predicted] > 0.02).all()
