"""`obscurance prune`."""

import numpy as np
import pytest
import trimesh
from command import obscurance, refused


@pytest.fixture
def engine(tmp_path, monkeypatch):
    """A closed body with an engine that nobody sees, and two wheels of one mesh, one of them inside."""
    monkeypatch.chdir(tmp_path)
    scene = trimesh.Scene()
    red = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255], name="red")
    body = trimesh.creation.box((2, 2, 2))
    body.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(body.vertices), 2)), material=red)
    scene.add_geometry(body, geom_name="body")
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=1, radius=0.5), geom_name="engine")
    wheel = trimesh.creation.box((0.4, 0.4, 0.4))
    scene.add_geometry(wheel, geom_name="wheel", transform=trimesh.transformations.translation_matrix([3, 0, 0]))
    inside = trimesh.transformations.translation_matrix([0, 0, 0.75])
    scene.graph.update("spare", "world", geometry="wheel", matrix=inside)
    scene.export("car.glb")
    return tmp_path


def test_the_engine_goes_and_materials_stay(engine):
    done = obscurance("prune", "car.glb", "-o", "out.glb")
    assert done.returncode == 0, done.stderr
    assert "out.glb: 36 faces; 80 that nothing outside sees are gone" in done.stdout
    found = trimesh.load_scene("out.glb")
    assert {name: len(part.faces) for name, part in found.geometry.items()} == {"body": 12, "wheel": 12}
    assert found.geometry["body"].visual.material.name == "red"


@pytest.mark.parametrize("ending", ["ply", "obj", "stl", "off"])
def test_other_formats(engine, ending):
    assert obscurance("prune", "car.glb", "-o", f"out.{ending}", "-q").returncode == 0
    assert len(trimesh.load(f"out.{ending}").faces) == 36  # the wheel that is inside is of the same mesh as the other


def test_what_is_refused(engine):
    refused(obscurance("prune", "car.glb", "-o", "out.png"), "output", ".glb")
    refused(obscurance("prune", "car.glb", "-o", "car.glb"), "car.glb")
    refused(obscurance("prune", "none.glb", "-o", "out.glb"), "none.glb")
    (engine / "bad.glb").write_bytes(b"glTF" + bytes(40))
    refused(obscurance("prune", "bad.glb", "-o", "out.glb"), "bad.glb")
    assert not (engine / "out.glb").exists()
