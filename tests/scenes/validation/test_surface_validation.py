"""The closed forms under `--method surface`: exact at a point, so the faces that it is fitted over are made small."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shared_directions import only_w

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.validation import table as validation

SIZE = 0.02
SAMPLES = 2048
OTHERS = "tilted normal", "inverted pyramid", "disk behind"  # two with normals of no face, one that the method refuses
LINES = [line for line in validation.configurations() if not line.name.startswith(OTHERS)]
COSTLY = "inside a cylinder"  # as the sphere, at ten times the cost: by one falloff


@pytest.fixture(scope="module", autouse=True)
def w_alone():
    with only_w():
        yield


def with_small_receivers(line):
    """The configuration with the flat pieces that only its points look out from shrunk around them."""
    vertices, faces = line.mesh.vertices.copy(), line.mesh.faces
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]]).T
    _, piece = connected_components(coo_array((np.ones(len(ends[0])), ends), (len(vertices),) * 2), directed=False)
    for point in line.points:
        connected = piece == piece[point]
        apart = vertices[connected] - vertices[point]
        _, _, thickness = np.linalg.svd(apart, compute_uv=False)
        if thickness < 1e-9 and np.count_nonzero(connected[line.points]) == 1:
            vertices[connected] = vertices[point] + min(1.0, SIZE / np.abs(apart).max()) * apart
    return replace(line, mesh=Mesh(vertices, faces, line.mesh.normals))


def baked_at(line, falloff):
    only = np.zeros(len(line.mesh.vertices), np.bool_)
    only[line.points] = True
    return ao.bake(line.mesh, falloff, SAMPLES, only=only, method="surface", **line.options)


def excess(line, baked):
    """By how much of four standard errors, .001 and the stand-in's own error w is off, at the worst of the points."""
    error = np.abs(baked.w[line.points] - line.exact)
    return float(np.max(error - (4 * baked.error[line.points] + 1e-3 + line.truncation + line.tessellation)))


@pytest.mark.parametrize(
    "line",
    [
        pytest.param(line, marks=[pytest.mark.slow] * (number % 2))
        for number, line in enumerate(LINES)
        if line.name != COSTLY or isinstance(line.falloff, ao.Binary)
    ],
    ids=lambda line: f"{line.name}, {validation.described(line.falloff)}",
)
def test_the_surface_method_matches_the_closed_form(line):
    small = with_small_receivers(line)
    baked = baked_at(small, small.falloff)
    assert excess(small, baked) <= 0
    assert np.max(baked.error[line.points]) < 0.03


def test_another_distance_would_not_match():
    lines = [line for line in LINES if isinstance(line.falloff, ao.Exponential) and "nothing" not in line.name][::4]
    caught = 0
    for line in lines:
        small = with_small_receivers(line)
        wrong = replace(line.falloff, tau=1.3 * line.falloff.tau)
        caught += excess(small, baked_at(small, wrong)) > 0
    assert caught > 0.8 * len(lines)
