"""Polygons of every sort become triangles that fill them."""

import numpy as np
import pytest
from mesh_files import mistake, obj, off, ply, read

from obscurance.raytrace.errors import MeshError
from obscurance.scenes.geometry.polygons import MAX_EAR_WORK, triangulate

U = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], float)
SQUARE = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)
HOLE = np.array([[1, 1], [1, 3], [3, 3], [3, 1]], float)
BRIDGED = np.concatenate([SQUARE[:1], HOLE, HOLE[:1], SQUARE[:1], SQUARE[1:]])
DART = np.array([[0, 0], [1, -1], [0, 2], [-1, -1]], float)
RNG = np.random.default_rng(3)
ANGLES = np.sort(RNG.random(500)) * 2 * np.pi
STAR = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1) * (0.2 + RNG.random((500, 1)))
SPIRAL_ANGLES = np.linspace(0, 6 * np.pi, 90)
SPIRAL = np.stack([np.cos(SPIRAL_ANGLES), np.sin(SPIRAL_ANGLES)], axis=1)
SPIRAL = np.concatenate([SPIRAL * (1 + SPIRAL_ANGLES)[:, None], (SPIRAL * (2 + SPIRAL_ANGLES)[:, None])[::-1]])[::-1]
CASES = {
    "U": (U, 7),
    "dart": (DART, 2),
    "hole": (BRIDGED, 12),
    "collinear": (np.array([[0, 0], [1, 0], [2, 0], [2, 2], [1, 1], [0, 2]], float), 3),
    "repeated": (np.array([[0, 0], [3, 0], [3, 0], [3, 3], [1, 1], [0, 3], [0, 3]], float), 6),
    "star": (STAR, None),
    "spiral": (SPIRAL, None),
}


def shoelace(polygon):
    x, y = polygon.T
    return (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2


def lifted(polygon, rotation=0):
    """The polygon as points in space, turned and far away; its normal."""
    tilt = np.linalg.qr(np.random.default_rng(rotation).normal(size=(3, 3)))[0]
    tilt *= np.linalg.det(tilt)
    return np.column_stack([polygon, np.zeros(len(polygon))]) @ tilt.T + 100, tilt[:, 2]


def areas(vertices, faces, normal):
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a) @ normal / 2


@pytest.mark.parametrize("first", range(8))
@pytest.mark.parametrize("name", CASES)
def test_triangles_fill_the_polygon_once_and_face_its_way(name, first):
    polygon, area = CASES[name]
    polygon = np.roll(polygon, first, axis=0)
    area = shoelace(polygon) if area is None else area
    for corners in (np.arange(len(polygon)), np.arange(len(polygon))[::-1]):
        vertices, normal = lifted(polygon, first)
        found = triangulate(vertices, corners, np.array([len(polygon)]))
        parts = areas(vertices, found.take(corners), normal if corners[0] == 0 else -normal)
        assert found.crossing == 0
        assert parts.sum() == pytest.approx(area)
        assert np.abs(parts).sum() == pytest.approx(area)


@pytest.mark.parametrize("name", ["m.obj", "m.ply", "m.off"])
def test_a_notch_stays_open_in_every_format(tmp_path, name):
    vertices = np.column_stack([U, 0 * U[:, 0]])
    made = {"m.obj": obj, "m.ply": ply, "m.off": off}[name](vertices, np.arange(8)[None])
    mesh = read(tmp_path, name, made).mesh
    np.testing.assert_array_equal(mesh.vertices, vertices)
    assert areas(mesh.vertices, mesh.faces, np.array([0, 0, 1])).sum() == pytest.approx(7)
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    assert not ((centres[:, 0] > 1) & (centres[:, 0] < 2) & (centres[:, 1] > 1)).any()


def test_what_a_fan_fills_stays_a_fan():
    """Triangles, convex polygons, bent ones too, and concave ones whose first corner sees all of them."""
    hexagon = np.stack([np.cos(np.arange(6)), np.sin(np.arange(6)), 0.2 * np.arange(6) % 0.3], axis=1)
    vertices = np.concatenate([hexagon, np.column_stack([DART, 0 * DART[:, 0]])])
    corners = np.array([0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
    found = triangulate(vertices, corners, np.array([3, 4, 6, 4]))
    fans = [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [6, 7, 8], [6, 8, 9]]
    assert found.take(corners).tolist() == fans
    assert found.counts.tolist() == [1, 2, 4, 2]


@pytest.mark.parametrize("count", [4, 5, 9])
def test_polygons_that_cross_themselves_are_counted(count):
    angles = np.arange(count) * 4 * np.pi / count if count > 4 else np.array([0, 2, 1, 3]) * np.pi / 2
    vertices = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    found = triangulate(vertices, np.arange(count), np.array([count]))
    assert found.crossing == 1
    assert len(found.take(np.arange(count))) > 0


def test_flat_and_empty_polygons_are_fans():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0.5, 0, 0]])
    corners = np.array([0, 1, 2, 3, 1, 1, 1, 1, 1, 0, 1])
    found = triangulate(vertices, corners, np.array([4, 5, 2]))
    assert found.counts.tolist() == [2, 3, 0]
    assert found.crossing == 0


@pytest.mark.parametrize("scale", [1e-300, 1e-20, 1e20, 1e150])
def test_size_does_not_matter(scale):
    vertices = np.column_stack([U, 0 * U[:, 0]]) * scale
    one = triangulate(vertices / scale, np.arange(8), np.array([8]))
    assert triangulate(vertices, np.arange(8), np.array([8])).places.tolist() == one.places.tolist()


def test_work_without_measure_is_refused(tmp_path):
    count = int(MAX_EAR_WORK**0.5) + 100
    comb = np.stack([np.arange(count), np.where(np.arange(count) % 2, 1, 0.01), np.zeros(count)], axis=1)
    with pytest.raises(MeshError, match="faces: expected concave polygons of at most 16,384 corners"):
        triangulate(comb, np.arange(count), np.array([count]))
    assert "one of 16,484" in mistake(tmp_path, "m.obj", obj(comb, np.arange(count)[None]))


@pytest.mark.parametrize("first", range(8))
def test_bent_polygons_are_cut_as_their_newell_plane_shows_them(first):
    bent = np.column_stack([3 * np.sin(U[:, 0] / 3), U[:, 1], 3 * np.cos(U[:, 0] / 3)])
    corners = np.roll(np.arange(8), first)
    faces = triangulate(bent, corners, np.array([8])).take(corners)
    normal = np.cross(bent, np.roll(bent, -1, axis=0)).sum(axis=0)
    parts = areas(bent, faces, normal / np.linalg.norm(normal))
    assert (parts > 0).all()
    assert parts.sum() == pytest.approx(np.linalg.norm(normal) / 2)


def test_no_corner_of_any_polygon_is_lost():
    rng = np.random.default_rng(5)
    for _ in range(300):
        count = int(rng.integers(4, 12))
        points = rng.normal(size=(count, 3)) * 10 ** rng.uniform(-1, 3, (count, 1))
        assert set(triangulate(points, np.arange(count), np.array([count])).take(np.arange(count)).ravel()) == set(
            range(count)
        )
