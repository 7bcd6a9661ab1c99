"""The same bytes after an interruption; another seed, other bytes."""

import numpy as np
import pytest
from interrupted_bakes import bits_of
from meshes import hills
from uv_meshes import grid_charts

import ao
from ao.execute.checkpoint import Checkpoint
from raytrace import Mesh

OPTIONS = {"size": 64, "samples": 256}


@pytest.fixture(scope="module")
def scene():
    mesh = Mesh(*hills(30))
    return mesh, grid_charts(len(mesh.faces))


def bits(texture):
    facts = np.array([texture.rays, texture.rmse, texture.facts.seam_jump, texture.facts.seam_jump_before])
    return bits_of(texture.w, texture.error, texture.bent_normals, texture.covered, facts)


@pytest.fixture(scope="module")
def whole(scene):
    return bits(ao.bake_texture(*scene, **OPTIONS))


def test_another_seed_changes_all_but_the_coverage(scene, whole):
    other = bits(ao.bake_texture(*scene, **OPTIONS, seed=1))
    assert [one == two for one, two in zip(other, whole, strict=True)] == [False, False, False, True, False]


@pytest.mark.parametrize("options", [{}, {"tolerance": 0.01, "samples": 4096}], ids=["samples", "tolerance"])
def test_an_interrupted_bake_continues_to_the_same_bytes(scene, tmp_path, options):
    class Stopped(Exception):
        pass

    def stop(done, total, stage):
        if stage.startswith("rays") and done > 0.5 * total:
            raise Stopped

    path, options = tmp_path / "w.partial", OPTIONS | options
    with pytest.raises(Stopped), Checkpoint(path, after=0, every=0, notify=lambda _: None) as checkpoint:
        ao.bake_texture(*scene, **options, checkpoint=checkpoint, progress=stop)
    assert path.exists()

    def goes_on(done, total, stage):
        pass

    with Checkpoint(path, resume=True, after=0, every=0, notify=lambda _: None) as checkpoint:
        again = ao.bake_texture(*scene, **options, checkpoint=checkpoint, progress=goes_on)
    assert bits(again) == bits(ao.bake_texture(*scene, **options))
    assert not path.exists()


def test_a_journal_of_another_page_is_refused(scene, tmp_path):
    class Stopped(Exception):
        pass

    def stop(done, total, stage):
        if stage == "rays":
            raise Stopped

    path = tmp_path / "w.partial"
    with pytest.raises(Stopped), Checkpoint(path, after=0, every=0, notify=lambda _: None) as checkpoint:
        ao.bake_texture(*scene, **OPTIONS, checkpoint=checkpoint, progress=stop)
    with pytest.raises(ValueError, match="another"), Checkpoint(path, resume=True) as checkpoint:
        ao.bake_texture(*scene, **OPTIONS | {"size": 97}, checkpoint=checkpoint)


def test_by_embree_alone_w_is_the_same(scene):
    one, other = (ao.bake_texture(*scene, **OPTIONS, traversal=traversal).w for traversal in ("auto", "embree"))
    assert np.abs(one - other).max() < 1e-3
