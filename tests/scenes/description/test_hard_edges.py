"""Scene files and pages shade a mesh file by its own normals at corners, and by ours across hard edges."""

import numpy as np
import pytest
from gltf_files import Builder
from hard_edges import CORNERS, FACES, INWARDS, OF
from mesh_files import obj, ply
from pages import columns_of, faces_of, vectors_of

from obscurance import raytrace
from obscurance.raytrace import Settings
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.formats.load import load
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values

TILTED = INWARDS + 0.3  # in front of each side, and none of ours


def files():
    builder = Builder()
    builder.mesh(builder.primitive(CORNERS.astype("<f4"), FACES.ravel().tolist()))
    return {
        "shared.ply": (ply(CORNERS, FACES), INWARDS),
        "shared.obj": (obj(CORNERS, FACES), INWARDS),
        "corners.obj": (obj(CORNERS, FACES, INWARDS, of=OF), INWARDS),
        "tilted.obj": (obj(CORNERS, FACES, TILTED, of=OF), TILTED),
        "bare.glb": (builder.glb([{"mesh": 0}]), INWARDS),
    }


@pytest.mark.parametrize("name", files())
@pytest.mark.parametrize("by_toml", [False, True])
def test_normals_at_corners_in_pictures(tmp_path, name, by_toml):
    content, normals = files()[name]
    (tmp_path / name).write_bytes(content)
    (tmp_path / "s.toml").write_text(
        f'[[lights]]\nlight = "directional"\ndirection = [-1, -2, -3]\nintensity = 3\n[[objects]]\nmesh = "{name}"\n'
    )
    described = read_scene(tmp_path / ("s.toml" if by_toml else name))
    (item,) = described.scene.objects
    mesh = item.shape.mesh
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals[mesh.faces], unit[OF], atol=1e-6)
    rows, total = described.file_vertices()
    np.testing.assert_array_equal(rows[mesh.faces], FACES)
    assert total == len(CORNERS)
    pictures = [
        raytrace.render(described.scene, described.camera, Settings(24, 24, samples=4, shading=shading, shadows=False))
        for shading in ("gouraud", "phong", "flat")
    ]
    gouraud, phong, flat = (each.layers["beauty"][..., :3] for each in pictures)
    assert (flat > 0).any()
    if normals is INWARDS and by_toml:
        np.testing.assert_allclose(gouraud, flat, atol=1e-5)
        np.testing.assert_allclose(phong, flat, atol=1e-5)


@pytest.mark.parametrize("name", files())
def test_normals_at_corners_in_pages(tmp_path, name):
    content, normals = files()[name]
    (tmp_path / name).write_bytes(content)
    mesh = load(tmp_path / name).mesh
    page = html_of_bakes(mesh, [Values(np.ones(len(mesh.vertices)))], name)
    columns = columns_of(page)
    corners = faces_of(columns).ravel()
    drawn = corners.copy()
    drawn[np.cumsum(columns["again"])] = len(mesh.vertices) + columns["further"]
    found = vectors_of(columns["normals"], 65535)[drawn].reshape(-1, 3, 3)
    places = mesh.vertices[corners].reshape(-1, 3, 3)
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    expected = {tuple(sorted(map(tuple, CORNERS[face]))): unit[of[0]] for face, of in zip(FACES, OF, strict=True)}
    for face, at_corners in zip(places, found, strict=True):
        of_face = expected[tuple(sorted(map(tuple, face)))]
        np.testing.assert_allclose(at_corners, [of_face] * 3, atol=1e-3)
