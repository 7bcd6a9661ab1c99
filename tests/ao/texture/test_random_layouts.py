"""Textures of layouts that are drawn anew, and of Blender's primitives: whatever they are, a page comes out."""

from pathlib import Path

import numpy as np
import pytest
import random_layouts

from obscurance import ao
from obscurance.raytrace import Mesh

pytestmark = pytest.mark.usefixtures("w_alone")

PRIMITIVES = np.load(Path(random_layouts.__file__).parent / "blender_primitives.npz")
NAMES = sorted({name.removesuffix("_uv") for name in PRIMITIVES.files if name.endswith("_uv")})
OPEN = {"cube", "uv_sphere", "ico_sphere", "cone", "cylinder", "grid"}  # convex or flat: w is 1


def checked(vertices, faces, uv, size, w, note):
    """Bake a page on one thread and on two, and check what holds for every page."""
    mesh = Mesh(vertices, faces)
    one, two = (ao.bake_texture(mesh, uv, size, ao.Binary(), samples=16, threads=threads) for threads in (1, 2))
    assert one.w.tobytes() == two.w.tobytes(), note
    assert one.w.min() >= 0, note
    assert one.w.max() <= 1, note
    assert np.isfinite(one.error).all(), note
    assert one.covered.any(), note
    assert one.facts.seam_jump <= one.facts.seam_jump_before + 1e-6, note
    if w is not None:
        curved = np.ptp(vertices[:, 2]) > 0  # about smooth normals 16 rays see only roughly what lies below faces
        np.testing.assert_allclose(one.w[one.covered].mean(), w, atol=0.25 if curved else 1e-6, err_msg=note)
        assert curved or one.w.min() > 1 - 1e-6, note
    return one


def drawn(kind, seed, sizes):
    """Check the page of one layout of a kind."""
    rng = np.random.default_rng([seed, random_layouts.KINDS.index(kind)])
    vertices, faces, uv, w = kind(rng)
    size = int(rng.choice(sizes))
    return checked(vertices, faces, uv, size, w, f"{kind.__name__} at {size}²; once more: --mesh-seed {seed}")


@pytest.mark.parametrize("kind", random_layouts.KINDS, ids=lambda kind: kind.__name__)
def test_pages_of_random_layouts(kind, pytestconfig):
    for seed in range(3):
        drawn(kind, pytestconfig.option.mesh_seed + seed, (16, 24, 32, 64, 100))


@pytest.mark.slow
@pytest.mark.parametrize("kind", random_layouts.KINDS, ids=lambda kind: kind.__name__)
def test_pages_of_many_random_layouts(kind, pytestconfig):
    for seed in range(200):
        drawn(kind, pytestconfig.option.mesh_seed + seed, (16, 17, 32, 64, 128, 256, 512))
    for seed in range(200, 203):
        drawn(kind, pytestconfig.option.mesh_seed + seed, (1024,))


@pytest.mark.filterwarnings("ignore::obscurance.ao.ToleranceWarning")  # said, as crumbs lie in layers
@pytest.mark.parametrize("count", [1, pytest.param(60, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", random_layouts.KINDS, ids=lambda kind: kind.__name__)
def test_pages_of_random_layouts_by_any_options(kind, count, pytestconfig):
    for seed in range(pytestconfig.option.mesh_seed, pytestconfig.option.mesh_seed + count):
        rng = np.random.default_rng([seed, random_layouts.KINDS.index(kind), 1])
        vertices, faces, uv, w = kind(rng)
        mesh = Mesh(vertices, faces)
        options = random_layouts.any_options(rng, mesh)
        size = int(rng.choice([16, 17, 32, 100, 256] if count > 1 else [16, 17, 32]))
        note = f"{kind.__name__} at {size}² by {options}; once more: --mesh-seed {seed}"
        one, two = (ao.bake_texture(mesh, uv, size, threads=threads, **options) for threads in (1, 2))
        assert one.w.tobytes() == two.w.tobytes(), note
        assert one.w.min() >= 0, note
        assert one.w.max() <= 1, note
        assert all(np.isfinite(page).all() for page in (one.error, one.bent_normals)), note
        if w == 1 and not np.ptp(vertices[:, 2]) and not options.get("thickness"):
            assert one.w.min() > 1 - 1e-6, note


@pytest.mark.parametrize("size", [16, 64, pytest.param(256, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NAMES)
def test_pages_of_blenders_primitives(name, size):
    vertices, faces, uv = (PRIMITIVES[f"{name}_{array}"].astype(float) for array in ("vertices", "faces", "uv"))
    texture = checked(vertices, faces.astype(int), uv, size, 1.0 if name in OPEN else None, name)
    on_hard_edges = ("cone", "cube", "cylinder")  # seams are none there
    assert texture.facts.seam_edges > 0 or name in ("grid", "torus", *on_hard_edges)
