"""High to low at vertices: w of a fine mesh at the vertices of a coarse one."""

import numpy as np
import pytest
import trimesh
from meshes import grid
from uv_meshes import floor_and_wall, quads, rectangle, square

from obscurance import ao
from obscurance.ao import closed_forms
from obscurance.raytrace import Mesh, MeshError
from obscurance.scenes.geometry.polyhedra import generic_rotation

PLACES = grid(8, 4.0)[0] + [2, 0, 0]


def floor():
    return Mesh(PLACES, grid(8)[1])


def sheet(side, height=0.0):
    """The unit square at a height, of side × side vertices."""
    vertices, faces = grid(side - 1)
    return np.add(vertices, [0.5, 0.5, height]), faces


def bumpy(subdivisions):
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    bumps = 1 + 0.15 * np.sin(6 * ball.vertices).prod(axis=1)
    return Mesh(ball.vertices * bumps[:, None], ball.faces)


@pytest.fixture(scope="module")
def coarse_and_fine():
    return bumpy(3), bumpy(5)


@pytest.mark.parametrize("height", [-0.01, 0.01])
@pytest.mark.parametrize("options", [{"samples": 1024}, {"samples": 1024, "denoise": False}, {"tolerance": 0.005}])
def test_w_is_that_of_the_fine_mesh_alone(height, options):
    baked = ao.bake(floor(), ao.Exponential(tau=1.0), high=floor_and_wall(height), cage=0.05, **options)
    exact = [closed_forms.wall(0.5 + x, tau=1.0) for x in PLACES[:, 0]]
    assert not baked.flags.any()
    assert np.abs(baked.w - exact).max() < (0.01 if "samples" in options else 0.025)
    assert (baked.bent_normals[PLACES[:, 0] == 0, 0] > 0.1).all()  # away from the wall


@pytest.mark.parametrize("denoise", [True, False])
def test_the_estimated_error_is_the_true_one(coarse_and_fine, denoise):
    coarse, fine = coarse_and_fine
    few, many = ({"samples": samples, "seed": samples, "high": fine, "cage": "20%"} for samples in (64, 8192))
    baked, reference = ao.bake(coarse, **few, denoise=denoise), ao.bake(coarse, **many, denoise=False)
    true = np.sqrt(np.mean((baked.w - reference.w) ** 2))
    assert true / 1.5 < baked.rmse < 1.5 * true


def test_what_the_cage_misses_takes_the_closest_point_and_is_flagged():
    half, _ = quads((rectangle((0, -2, 0.01), (1.9, 0, 0), (0, 4, 0)), square(0, 0, 1, 1)))
    baked = ao.bake(floor(), samples=8, high=half, cage=0.05)
    assert np.array_equal((baked.flags & ao.Flag.MISSED) != 0, PLACES[:, 0] > 1.9)
    assert baked.flagged["missed"] == (PLACES[:, 0] > 1.9).sum()
    assert (baked.w == 1).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_border_that_both_meshes_have_is_not_missed(seed):
    """Rays along the normal of a vertex on the border of the fine mesh pass beside it by rounding; lifted, as well."""
    rng = np.random.default_rng(seed)
    pose = generic_rotation(seed)
    where, height = rng.normal(size=3), rng.choice([0.0, 0.01])
    for side, finer in ((2, 40), (8, 64), (9, 33)):
        coarse, fine = ((pose.apply(v) + where, f) for v, f in (sheet(side), sheet(finer, height)))
        baked = ao.bake(Mesh(*coarse), samples=8, high=Mesh(*fine), cage=0.02, seed=seed)
        assert not baked.flags.any()
        assert (baked.w == 1).all()


def test_a_border_farther_out_than_that_of_the_fine_mesh_is_missed():
    vertices, faces = sheet(8)
    baked = ao.bake(Mesh(vertices * 1.01, faces), samples=8, high=Mesh(*sheet(64)), cage=0.02)
    assert np.array_equal((baked.flags & ao.Flag.MISSED) != 0, (vertices == 1).any(axis=1))


@pytest.mark.parametrize("scale", [1e-40, 1e40])
def test_meshes_whose_sizes_single_precision_does_not_hold_together(scale):
    fine = Mesh(floor().vertices * scale, floor().faces, source="fine.obj")
    coarse, uv = quads((rectangle((0, -2, 0), (4, 0, 0), (0, 4, 0)), square(0, 0, 1, 1)))
    refusal = r"fine.obj: size: expected from 1e-12 to 1e\+12 times that of"
    with pytest.raises(MeshError, match=refusal):
        ao.bake(coarse, samples=8, high=fine)
    with pytest.raises(MeshError, match=refusal):
        ao.bake_texture(coarse, uv, size=4, samples=8, high=fine)


@pytest.mark.parametrize("interior", ["auto", "mark", "ignore"])
def test_vertices_inside_of_solids_of_the_fine_mesh(interior):
    """A box stands on the floor: w under it is that of the floor about it, or that of its inside."""
    box = trimesh.creation.box(bounds=[[0.9, -0.6, -0.1], [2.1, 0.6, 1]])
    ground = floor_and_wall(0.0)
    both = Mesh(np.concatenate([ground.vertices[:4], box.vertices]), np.concatenate([ground.faces[:2], box.faces + 4]))
    baked = ao.bake(floor(), ao.Binary(), samples=64, high=both, cage=0.05, interior=interior)
    under = (np.abs(PLACES[:, 0] - 1.5) < 0.55) & (np.abs(PLACES[:, 1]) < 0.55)
    flagged = (baked.flags & ao.Flag.HIDDEN) != 0
    assert np.array_equal(flagged, under & (interior != "ignore"))
    assert (baked.w[under] > 0.2).all() == (interior == "auto")
    assert (baked.w[under] < 0.001).all() == (interior != "auto")


def test_percentages_are_of_the_coarse_mesh():
    vertices, faces = sheet(9)
    aside = vertices + np.array([5, 0, 0])
    fine = Mesh(np.append(vertices, aside, axis=0), np.append(faces, faces + len(vertices), axis=0))
    coarse = Mesh(*sheet(3))
    baked = ao.bake(coarse, ao.Exponential(half_distance="50%"), high=fine, samples=64, profile=True)
    assert np.log(2) / baked.mu.tau == pytest.approx(0.5 * 0.5**0.5)
    assert baked.profile.radius == pytest.approx(0.5**0.5)
    uv = np.tile(np.array([[[0, 0], [1, 0], [1, 1]]]), (len(coarse.faces), 1, 1))
    textured = ao.bake_texture(coarse, uv, 8, ao.Binary(max_distance="80%"), high=fine, samples=64)
    assert textured.mu.max_distance == pytest.approx(0.8 * 0.5**0.5)
