"""What is refused says in one line what to do instead."""

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from gltf_files import Builder
from mesh_files import obj
from meshes import hills

from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake

VERTICES = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\n"


@pytest.fixture
def mesh(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(4)))
    return tmp_path / "hills.obj"


def test_a_mesh_without_texture_coordinates_gets_the_options_that_make_some(mesh):
    advice = "--uv unwrap --mesh-output hills-uv.glb"
    refused(obscurance("bake", mesh, "-o", mesh.with_suffix(".png"), "--size", 64), "texture coordinates", advice)
    spaced = mesh.rename(mesh.with_name("two hills.obj"))
    advice = "--uv unwrap --mesh-output 'two hills-uv.glb' makes some"
    refused(obscurance("bake", spaced, "-o", mesh.with_suffix(".png"), "--size", 64), advice)


def test_a_row_with_another_number_of_numbers_is_named(tmp_path):
    rows = "0 0 0\n1 0 0\n0 1\n3 0 1 2\n"
    (tmp_path / "m.ply").write_text(f"ply\nformat ascii 1.0\n{VERTICES}{FACES}end_header\n{rows}")
    words = "m.ply: element vertex, row 2: expected 3 numbers, got 2"
    refused(obscurance("bake", tmp_path / "m.ply", "-o", tmp_path / "w.npy"), words)


def test_advice_about_texture_coordinates_reads_none_that_are_malformed(tmp_path):
    """A bake at vertices has no use for them, and is written before it gives advice."""
    builder = Builder()
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "<f4")
    vertices = np.concatenate([square, 0.3 * square + np.array([0, 0, 0.05], "<f4")])  # a lid over a floor
    primitive = builder.primitive(vertices, np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]))
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(vertices[:, :2].copy(), "VEC2", byteOffset=4)
    builder.mesh(primitive)
    (tmp_path / "m.glb").write_bytes(builder.glb([{"mesh": 0}]))
    done = succeeded("bake", tmp_path / "m.glb", "-o", tmp_path / "w.glb", "--samples", 64)
    assert "--occlusion texture --uv unwrap" in done.stderr


@pytest.mark.parametrize("preset", ["unreal", "blender", "three"])
def test_a_size_asks_a_preset_for_a_texture(mesh, preset):
    given = BakeOptions(mesh=[mesh], output=mesh.with_suffix(".glb"), preset=preset)
    assert plan_bake(given.replaced(size="64")).kind == "texture"
    assert plan_bake(given).kind == ("texture" if preset == "unreal" else "vertices")
