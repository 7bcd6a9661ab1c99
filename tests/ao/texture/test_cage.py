"""A cage that is a mesh: from where points of the coarse mesh look for the fine one, in which direction and how far."""

import numpy as np
import pytest
from meshes import hills
from uv_meshes import quads, rectangle, square

from obscurance import ao
from obscurance.ao.options import VertexOptions
from obscurance.ao.points.projection import FineMesh
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.prepared import Prepared
from obscurance.raytrace import Mesh, MeshError, OptionError
from obscurance.raytrace.mesh.placement import Placement

FINE = Mesh(*hills(12))


def sheet(side=9):
    """The unit square at z = 0, of side × side vertices: its vertices and faces."""
    vertices, faces = hills(side)
    return (vertices * [1, 1, 0] + [1, 1, 0]) / 2, faces


def first_hits(starts, directions, reach, mesh):
    """Where rays meet a mesh first, NaN for nowhere: all faces one by one (Möller & Trumbore 1997)."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    found = np.full((len(starts), 3), np.nan)
    for row, (o, d, most) in enumerate(zip(starts, directions, reach, strict=True)):
        across = np.cross(d, c - a)
        determinant = np.einsum("fi,fi->f", across, b - a)
        u = np.einsum("fi,fi->f", across, o - a) / determinant
        other = np.cross(o - a, b - a)
        v, t = (np.einsum("fi,fi->f", each, other) / determinant for each in (np.broadcast_to(d, a.shape), c - a))
        t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= most), t, np.inf)
        if t.min() < np.inf:
            found[row] = o + t.min() * d
    return found


@pytest.mark.parametrize("grouped", [False, True])
def test_points_are_found_where_an_independent_projection_finds_them(grouped):
    """Rays of any direction and length, some of which end before they meet the hills; in groups, only their own."""
    rng = np.random.default_rng(7)
    places = np.column_stack([rng.uniform(-0.8, 0.8, (400, 2)), np.zeros(400)])
    cage = places + np.column_stack([rng.normal(size=(400, 2)) * 0.2, rng.uniform(0.05, 0.7, 400)])
    outwards = cage - places
    reach = np.linalg.norm(outwards, axis=1)
    own, of_vertex = rng.integers(0, 3, 400) * grouped, rng.integers(0, 3, len(FINE.vertices)) * grouped
    of_face, expected = of_vertex[FINE.faces[:, 0]], np.full((400, 3), np.nan)
    for group in range(3):
        rows, alone = own == group, Mesh(FINE.vertices, FINE.faces[of_face == group]) if grouped or not group else FINE
        expected[rows] = first_hits(cage[rows], -outwards[rows] / reach[rows, None], 2 * reach[rows], alone)
    groups = (own, of_vertex) if grouped else None
    prepared = Prepared.of(FINE, VertexOptions(), None, None)
    fine = FineMesh("fine", prepared.placement, prepared.receivers, 2)
    placed = (places - prepared.placement.centre) * prepared.placement.scale
    up = np.tile([0.0, 0, 1], (400, 1))
    on_fine, missed = fine.project(placed, up, cage, groups)
    corners = FINE.vertices[prepared.receivers.faces[on_fine.face]]
    found = np.einsum("kc,kci->ki", on_fine.barycentric, corners)
    met = ~np.isnan(expected[:, 0])
    assert 50 < met.sum() < 390
    np.testing.assert_allclose(found[met], expected[met], atol=1e-5)
    assert set(missed) <= set(np.flatnonzero(~met))
    assert len(missed) > 0.9 * (~met).sum()  # others end beside the surface, within a hundredth
    assert (of_vertex[prepared.receivers.faces[on_fine.face, 0]] == own).all()


def ceiling(height=0.1, floor=-0.01):
    """A large floor, and over all of it, so near that the floor is closed, a ceiling."""
    return quads(
        (rectangle((-60, -60, floor), (121, 0, 0), (0, 121, 0)), square(0, 0, 1, 1)),
        (rectangle((-60, -60, height), (121, 0, 0), (0, 121, 0)), square(0, 0, 1, 1)),
    )[0]


def test_a_cage_of_varying_height_lies_inside_or_outside_of_a_ceiling():
    vertices, faces = sheet()
    cage = Mesh(vertices + np.outer(0.05 + 0.1 * vertices[:, 0], [0, 0, 1]), faces)
    options = {"falloff": ao.Binary(), "samples": 32, "high": ceiling(), "cage": cage}
    baked = ao.bake(Mesh(vertices, faces), **options)
    above = vertices[:, 0] > 0.51
    assert not baked.flags.any()
    np.testing.assert_allclose(baked.w[vertices[:, 0] < 0.49], 0, atol=0.01)
    assert (baked.w[above] == 1).all()
    texture = ao.bake_texture(Mesh(vertices, faces), vertices[:, :2], 32, **options)
    assert texture.facts.missed == 0
    np.testing.assert_allclose(texture.w[:, :15], 0, atol=0.01)
    assert (texture.w[:, 17:] == 1).all()


def test_a_cage_moved_sideways_looks_sideways():
    """Over half a floor stands a step; points before it whose rays come from over it lie on it."""
    step, _ = quads(
        (rectangle((-60, -60, 0), (121, 0, 0), (0, 121, 0)), square(0, 0, 1, 1)),
        (rectangle((0.51, -60, 0.1), (60, 0, 0), (0, 121, 0)), square(0, 0, 1, 1)),
    )
    vertices, faces = sheet()
    straight, aslant = (Mesh(vertices + np.array([aside, 0, 0.2]), faces) for aside in (0, 0.3))
    coarse, options = Mesh(vertices, faces), {"samples": 64, "denoise": False, "high": step}
    where = [ao.bake(coarse, ao.Binary(), cage=each, **options).w for each in (straight, aslant)]
    for w, edge in zip(where, (0.51, 0.36), strict=True):
        x = vertices[:, 0]
        assert (w[x > edge] == 1).all()
        assert (w[(x > edge - 0.2) & (x < edge)] < 0.99).all()


@pytest.mark.parametrize("shape", ["sheet", "hills"])
def test_a_cage_at_a_distance_along_the_smooth_normals_is_that_distance(shape):
    """To the bit at vertices whose coordinates are round, else but for the rounding of where rays start."""
    vertices, faces = sheet() if shape == "sheet" else hills(9)
    coarse = Mesh(vertices, faces)
    found = find_receivers(coarse, Placement.of(coarse))
    outwards = found.points.normals[found.of_vertex].astype(np.float64)
    fine = Mesh(*hills(32)) if shape == "hills" else Mesh(hills(32)[0] * [1, 1, 0.1] + [0.5, 0.5, 0], hills(32)[1])
    cages = 0.125, Mesh(vertices + 0.125 * outwards, faces)
    one, other = (ao.bake(coarse, samples=32, high=fine, cage=cage) for cage in cages)
    np.testing.assert_allclose(one.w, other.w, atol=1e-6 if shape == "hills" else 0)
    np.testing.assert_array_equal(one.flags, other.flags)
    if shape == "sheet":
        one, other = (ao.bake_texture(coarse, vertices[:, :2], 24, samples=16, high=fine, cage=cage) for cage in cages)
        np.testing.assert_allclose(one.w, other.w, atol=1e-6)
        assert one.facts.missed == other.facts.missed


def test_a_cage_that_touches_the_mesh_finds_what_lies_on_it():
    vertices, faces = sheet()
    mesh = Mesh(vertices, faces)
    assert not ao.bake(mesh, samples=8, high=mesh, cage=mesh).flags.any()
    with pytest.raises(MeshError, match="expected some of it within the cage"):
        ao.bake(mesh, samples=8, high=Mesh(vertices + np.array([0, 0, 0.1]), faces), cage=mesh)


def test_a_cage_of_another_mesh_is_refused():
    vertices, faces = sheet()
    mesh = Mesh(vertices, faces, source="low")
    for wrong, message in (
        (Mesh(*sheet(8), source="cage"), r"cage: vertices: expected 81, as low has, got 64"),
        ((vertices, faces[1:]), r"cage: faces: expected 128, as low has, got 127"),
        ([1, 2, 3], "cage: mesh: expected a raytrace.Mesh, a pair"),
    ):
        with pytest.raises(MeshError, match=message):
            ao.bake(mesh, high=mesh, cage=wrong)
        with pytest.raises(MeshError, match=message):
            ao.bake_texture(mesh, vertices[:, :2], 8, high=mesh, cage=wrong)


def test_a_group_without_a_fine_face_is_refused():
    vertices, faces = sheet()
    mesh, groups = Mesh(vertices, faces), (np.full(81, 2), np.ones(81, np.int64))
    with pytest.raises(OptionError, match="groups: expected faces of the fine mesh in each, got none in 2"):
        ao.bake(mesh, high=mesh, groups=groups)
    with pytest.raises(OptionError, match="groups: expected"):
        ao.bake_texture(mesh, vertices[:, :2], 8, high=mesh, groups=groups)
