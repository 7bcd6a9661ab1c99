"""Profiles in files: written, read back, replaced and left out."""

import math

import numpy as np
import pytest
import validator
from gltf_files import HALVES, QUAD, Builder
from mesh_files import with_profile
from meshes import hills

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.errors import SceneError
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.falloffs import make_scales
from obscurance.scenes.formats.images import write_grey
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import find_profile, read_w
from obscurance.scenes.formats.write import write


@pytest.fixture(scope="module")
def bake():
    return with_profile(ao.bake(Mesh(*hills(5)), samples=4))


@pytest.fixture(scope="module")
def source(tmp_path_factory, bake):
    """A mesh file of which a .glb repeats no vertex."""
    path = tmp_path_factory.mktemp("source") / "hills.ply"
    write(path, ao.bake(bake.mesh, samples=4), Asset.of(bake.mesh))
    return path


@pytest.mark.parametrize(("ending", "error"), [(".npz", 0), (".ply", 0), (".glb", 0.5 / 65535)])
@pytest.mark.parametrize(("columns", "limit"), [(1, math.inf), (4, 0.1), (10, math.inf), (10, 3.3)])
def test_what_is_written_is_read_back(tmp_path, source, bake, ending, error, columns, limit):
    path, baked = tmp_path / f"baked{ending}", with_profile(bake, columns, limit=limit)
    write(path, baked, load(source, path))
    found, count = find_profile(path), len(bake.w)
    assert np.array_equal(found.half_distances, baked.profile.half_distances)
    assert (found.radius, found.max_distance) == (baked.profile.radius, limit)
    assert np.abs(found.values[:count] - baked.profile.values).max() <= error + 1e-7
    half_distance = baked.profile.half_distances[0] * (1.3 if columns > 1 else 1)
    w = read_w(path, count, scales=make_scales(half_distance))
    assert np.abs(w - baked.profile.at(half_distance)).max() <= 4 * error + 1e-6
    assert np.allclose(read_w(path, count), baked.w, atol=1e-6)


@pytest.mark.parametrize("ending", [".ply", ".glb"])
def test_a_bake_of_a_baked_file_replaces_its_profile(tmp_path, source, bake, ending):
    first, again = (tmp_path / f"{name}{ending}" for name in ("first", "again"))
    write(first, bake, load(source, first))
    count, other = len(load(first).mesh.vertices), with_profile(ao.bake(load(first).mesh, samples=4), 5, seed=1)
    write(again, other, load(first, again))
    assert find_profile(again).values.shape == (count, 5)
    assert np.allclose(find_profile(again).values, other.profile.values, atol=1e-5)


def test_a_glb_of_several_objects_has_one_profile(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    data = builder.glb([{"mesh": 0, "name": "one"}, {"mesh": 0, "name": "two", "translation": [0, 0, 2]}])
    (tmp_path / "quads.glb").write_bytes(data)
    file = load(tmp_path / "quads.glb", tmp_path / "baked.glb")
    baked = with_profile(ao.bake(file.mesh, samples=4))
    write(tmp_path / "baked.glb", baked, file)
    assert np.allclose(find_profile(tmp_path / "baked.glb").values, baked.profile.values, atol=1e-5)
    if not validator.missing():
        assert validator.errors(tmp_path / "baked.glb") == [[]]


def test_a_page_of_texels_has_layers(tmp_path):
    values = np.random.default_rng(2).random((6, 8, 10), np.float32)
    profile = ao.Profile(0.1 * 2.0 ** np.arange(10), values, 3.3, 0.25)
    write_grey(tmp_path / "page.exr", values[..., 3], False, {"content": "w"}, profile=profile)
    write_grey(tmp_path / "plain.exr", values[..., 3], False, {"content": "w"})
    found = find_profile(tmp_path / "page.exr")
    assert np.array_equal(found.values, values)
    assert np.array_equal(found.half_distances, profile.half_distances)
    assert (found.radius, found.max_distance) == (3.3, 0.25)
    assert find_profile(tmp_path / "plain.exr") is None


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(b"obscurance_03", b"obscurance_13"),
        lambda text: text.replace(b"comment obscurance profile: ", b"comment obscurance profile: x "),
        lambda text: text.replace(b"comment obscurance profile: ", b"comment obscurance prefiel: "),
    ],
)
def test_a_ply_whose_columns_or_lengths_are_missing_has_no_profile(tmp_path, source, bake, change):
    path = tmp_path / "baked.ply"
    write(path, bake, load(source, path))
    path.write_bytes(change(path.read_bytes()))
    assert find_profile(path) is None
    assert load(path).w is not None


def test_an_archive_that_is_none_is_refused(tmp_path):
    path = tmp_path / "w.npz"
    path.write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(SceneError):
        find_profile(path)
    np.savez(path, w=np.ones(3), profile=np.full((3, 2), 7.0), half_distances=[1, 2], radius=1)
    assert find_profile(path) is None
    with pytest.raises(SceneError) as fault:
        read_w(path, 3, scales=make_scales(1))
    assert fault.value.field == "profile"
