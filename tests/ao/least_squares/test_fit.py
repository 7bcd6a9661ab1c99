"""Samples of a surface, the least-squares problem and its solver, each by itself."""

import numpy as np
import pytest
import trimesh
from meshes import grid
from scipy.optimize import lsq_linear
from scipy.sparse import csr_array
from scipy.spatial import Delaunay

from obscurance.ao.least_squares.conjugate_gradients import solve, solve_within
from obscurance.ao.least_squares.face_moments import Samples, sample_barycentric
from obscurance.ao.least_squares.fit import NormalEquations, Problem, cross_validated
from obscurance.ao.least_squares.pattern import Stencil, add_faces, add_jumps, add_laplacian, find_hinges, right_side
from obscurance.raytrace.mesh.normals import face_normals


def barycentric(samples):
    """Face (k,) and coordinates (k, 3) of all samples."""
    face = np.repeat(np.arange(len(samples.weights)), np.diff(samples.starts))
    at = [
        sample_barycentric.function(k, samples.shift, samples.ends[f], samples.ends[f + 1]) for k, f in enumerate(face)
    ]
    return face, np.array(at)


@pytest.mark.parametrize("count", [1, 7, 100, 3000])
@pytest.mark.parametrize("shift", [0.0, 0.37, 0.999])
def test_every_sample_lies_on_one_face_and_they_share_out_the_area(count, shift):
    areas = np.random.default_rng(0).lognormal(sigma=1.5, size=200)
    samples = Samples.spread(areas, count, shift)
    assert samples.starts[0] == 0
    assert samples.starts[-1] == count
    assert (np.abs(np.diff(samples.starts) - np.diff(samples.ends)) <= 1 + 1e-9).all()
    np.testing.assert_allclose((samples.weights * np.diff(samples.ends)).sum(), 1)
    _, at = barycentric(samples)
    np.testing.assert_allclose(at.sum(axis=1), 1)
    assert (at >= -1e-12).all()


def test_samples_are_spread_evenly_within_a_face():
    """A function's mean over a triangle, by 128 samples, is closer than what 2,000 random ones would give."""
    samples = Samples.spread(np.ones(1), 128, 0.5)
    _, at = barycentric(samples)
    np.testing.assert_allclose(at.mean(axis=0), 1 / 3, atol=3e-3)
    np.testing.assert_allclose((at[:, 0] * at[:, 1]).mean(), 1 / 12, atol=1.5e-3)


def stencil_of(face_points, normals, agreement=np.cos(np.radians(30))):
    face_points = face_points.astype(np.int32)
    count = int(face_points.max()) + 1
    hinges = find_hinges(face_points, normals, agreement, count)
    return Stencil.of(face_points, hinges, count), hinges


def rough(mesh, face_points=None, **agreement):
    normals, areas = face_normals(mesh.vertices, mesh.faces)
    stencil, hinges = stencil_of(mesh.faces if face_points is None else face_points, normals, **agreement)
    return stencil.matrix(stencil.sum(add_jumps, hinges, mesh.triangles, areas))


def test_roughness_is_the_squared_jump_of_the_gradients_on_a_plane():
    rng = np.random.default_rng(3)
    vertices = np.append(rng.uniform(size=(30, 2)), np.zeros((30, 1)), axis=1)
    mesh = trimesh.Trimesh(vertices, Delaunay(vertices[:, :2]).simplices, process=False)
    mesh.fix_normals()
    x = rng.normal(size=30)
    gradients = []
    for face in mesh.faces:
        system = np.append(vertices[face, :2], np.ones((3, 1)), axis=1)
        gradients.append(np.linalg.solve(system, x[face])[:2])
    jumps = np.diff(np.array(gradients)[mesh.face_adjacency], axis=1)[:, 0]
    expected = ((jumps**2).sum(axis=1) * mesh.area_faces[mesh.face_adjacency].sum(axis=1)).sum()
    assert x @ (rough(mesh) @ x) == pytest.approx(expected)
    linear = vertices @ [0.3, -2, 0] + 0.7
    assert linear @ (rough(mesh) @ linear) == pytest.approx(0, abs=1e-9)


def test_hard_edges_are_not_smoothed_over():
    box = trimesh.creation.box()
    matrix = rough(box)
    x = np.random.default_rng(0).normal(size=8)
    folds = x @ (rough(box, agreement=-1) @ x)
    assert 0 < x @ (matrix @ x) < 0.8 * folds  # the diagonals of the sides remain
    apart = np.arange(36).reshape(-1, 3)
    assert np.abs(rough(box, apart)).max() == 0


def upper_triangles(b):
    return np.stack([b[:, i] * b[:, j] for i in range(3) for j in range(i, 3)], axis=1)


def random_problem(count=40, seed=0):
    rng = np.random.default_rng(seed)
    b = rng.random((200, count)) * (rng.random((200, count)) < 0.1)
    f = rng.normal(0.5, 1.0, 200)
    return b, f, csr_array(b.T @ b + 1e-3 * np.eye(count)), b.T @ f


def test_conjugate_gradients_solve():
    _, _, matrix, right = random_problem()
    np.testing.assert_allclose(solve(matrix, right, np.zeros(40)), np.linalg.solve(matrix.toarray(), right), atol=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_the_bounded_minimum_is_the_one_of_scipy(seed):
    b, f, matrix, right = random_problem(seed=seed)
    found = solve_within(matrix, right, np.full(40, 0.5))
    expected = lsq_linear(np.concatenate([b, np.sqrt(1e-3) * np.eye(40)]), np.append(f, np.zeros(40)), (0, 1)).x
    assert (expected < 1e-6).any()
    np.testing.assert_allclose(found, expected, atol=1e-4)
    plain = np.clip(np.linalg.solve(matrix.toarray(), right), 0, 1)
    assert np.abs(plain - expected).max() > 1e-2  # a clamp at the end would not do


@pytest.mark.parametrize("seed", [1, 6])
def test_the_bounded_minimum_is_found_where_smoothing_outweighs_faint_data(seed):
    """Squared second differences, which tie what is far apart, and data of weights from 1e-8 to 1e-2."""
    rng = np.random.default_rng(seed)
    count, far = 300, np.repeat(rng.integers(0, 2, 10), 30)
    weights = np.where(far, 1e-5, 1e-2) * rng.uniform(0.01, 1, count) * (rng.random(count) < 0.7)
    bends = np.diff(np.eye(count), 2, axis=0)
    bends[148:150] = 0  # two parts that do not meet
    weights[150:] *= 0.1
    values = rng.normal(0.5, 0.6, count)
    root = np.concatenate([np.diag(np.sqrt(weights)), bends])
    matrix, right = csr_array(root.T @ root), weights * values
    expected = lsq_linear(root, np.append(np.sqrt(weights) * values, np.zeros(len(bends))), (0, 1), method="bvls").x
    assert min(np.sum(expected < 1e-6), np.sum(expected > 1 - 1e-6)) > 0
    np.testing.assert_allclose(solve_within(matrix, right, np.full(count, 0.5)), expected, atol=1e-3)


def fit(noise, smooth, per_face=3, seed=0):
    """α chosen for samples of a function on a plane's grid, as a part of that at which R and the data weigh alike."""
    rng = np.random.default_rng(seed)
    vertices, faces = grid(11)
    vertices[:, :2] += 0.5
    normals, areas = face_normals(vertices, faces)
    stencil, hinges = stencil_of(faces, normals)
    halves = []
    for _ in (0, 1):
        face = np.repeat(np.arange(len(faces)), per_face)
        b = rng.dirichlet([1, 1, 1], len(face))
        at = np.einsum("kc,kci->ki", b, vertices[faces[face]])
        f = smooth(at) + noise * rng.normal(size=len(face))
        entries, right = np.zeros((len(faces), 6)), np.zeros((len(faces), 3))
        np.add.at(entries, face, upper_triangles(b))
        np.add.at(right, face, b * f[:, None])
        halves.append(NormalEquations(stencil.sum(add_faces, entries), right_side(stencil, right), float(f @ f)))
    smoothness = stencil.sum(add_jumps, hinges, vertices[faces], areas)
    nothing = np.zeros((3, len(vertices)))
    laplacian, zero = np.full(len(faces), 1e-9), nothing[0]
    problem = Problem(stencil, tuple(halves), zero, smoothness, laplacian, zero, nothing, 1, None)
    alpha, fits = cross_validated(problem, zero)
    data, prior = (
        stencil.matrix(values).diagonal().sum() for values in (halves[0].values + halves[1].values, smoothness)
    )
    unit = data / prior
    return alpha / unit, fits, vertices


def test_linear_functions_are_reproduced_whatever_the_smoothing():
    def linear(at):
        return at @ [0.3, 0.5, 0] + 0.1

    _, fits, vertices = fit(0.0, linear)
    for x in fits:
        np.testing.assert_allclose(x, linear(vertices), atol=1e-4)


def test_ties_are_the_squared_differences_along_edges():
    rng = np.random.default_rng(0)
    face_points, weights, x = rng.integers(0, 9, (20, 3)), rng.random(20), rng.random(9)
    stencil, _ = stencil_of(face_points, np.tile([0.0, 0, 1], (20, 1)))
    values = stencil.sum(add_laplacian, weights)
    expected = (weights[:, None] * (x[face_points] - np.roll(x[face_points], 1, axis=1)) ** 2).sum()
    assert x @ (stencil.matrix(values) @ x) == pytest.approx(expected)
