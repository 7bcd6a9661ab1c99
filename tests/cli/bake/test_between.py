"""`--between`: faces are cut where interpolated w errs, and all that a file holds is kept."""

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from gltf_samples import skinned
from reference import cosine_directions, nearest_hits

import obscurance as package

ASKED = 0.04


def boxes(seed):
    """Boxes of random sizes on a floor, as one mesh of flat faces."""
    rng = np.random.default_rng(seed)
    parts = [trimesh.creation.box((8, 8, 0.2))]
    for place in [(-2, -2), (1, -2.5), (-1.5, 1.5), (2, 2)]:
        size = rng.uniform(0.5, 2.5, 3)
        part = trimesh.creation.box(size)
        part.apply_translation([*(place + rng.uniform(-0.3, 0.3, 2)), 0.101 + size[2] / 2])
        parts.append(part)
    return trimesh.util.concatenate(parts)


def errors_between(path, scene, seed):
    """Squared errors of interpolated w at random points of a baked file, by binary falloff and a slow caster; two
    independent estimates of each make them unbiased."""
    rng = np.random.default_rng(seed)
    asset = package.load(path)
    mesh, w = asset.mesh, asset.w
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    squares = []
    for face in rng.choice(len(areas), 300, p=areas / areas.sum()):
        weights = rng.dirichlet((1, 1, 1))
        normal = across[face] / areas[face]
        origin = weights @ corners[face] + 1e-6 * normal
        directions = cosine_directions(rng, normal, 400)
        is_open = np.isinf(nearest_hits(np.broadcast_to(origin, directions.shape), directions, scene.triangles))
        off = weights @ w[mesh.faces[face]] - is_open.reshape(2, -1).mean(axis=1)
        squares.append(off.prod())
    return np.array(squares)


@pytest.mark.parametrize(("source", "output", "seed"), [(".stl", ".glb", 1), (".obj", ".ply", 2)])
def test_interpolated_w_errs_by_what_is_asked_with_few_vertices(tmp_path, source, output, seed):
    scene = boxes(seed)
    given = tmp_path / f"boxes{source}"
    if output == ".glb":  # with a vertex for each side of hard edges, as an OBJ gets it
        scene = trimesh.Trimesh(
            scene.triangles.reshape(-1, 3), np.arange(3 * len(scene.faces)).reshape(-1, 3), process=False
        )
    scene.export(given)
    plain, cut = tmp_path / f"plain{output}", tmp_path / f"cut{output}"
    how = "--falloff", "binary", "--up", "y"
    succeeded("bake", given, "-o", plain, *how)
    done = succeeded("bake", given, "-o", cut, "--between", ASKED, *how)
    assert "vertices became" in done.stdout
    before, after = errors_between(plain, scene, seed), errors_between(cut, scene, seed)
    assert before.mean() > (2.5 * ASKED) ** 2
    assert after.mean() < (1.25 * ASKED) ** 2 + 3 * after.std() / np.sqrt(len(after))
    assert len(package.load(cut).mesh.vertices) < 3000


def test_edges_stay_shared_and_faces_where_they_were(tmp_path):
    scene = boxes(4)
    scene.export(tmp_path / "boxes.obj")
    succeeded("bake", tmp_path / "boxes.obj", "-o", tmp_path / "cut.ply", "--between", 0.1)
    cut = trimesh.load(tmp_path / "cut.ply", process=False)
    assert len(cut.faces) > 2 * len(scene.faces)
    cut.merge_vertices(merge_norm=True)  # of the sides of hard edges
    assert cut.is_watertight
    assert cut.is_winding_consistent
    assert cut.volume == pytest.approx(scene.volume, rel=1e-6)
    assert cut.area == pytest.approx(scene.area, rel=1e-6)


def test_what_vertices_and_polygons_have_is_kept(tmp_path):
    """Texture coordinates that are linear in the place stay so at new vertices; objects and materials stay theirs."""
    scene = boxes(5)
    lines = [f"v {x} {y} {z}" for x, y, z in scene.vertices] + [f"vt {x / 9} {y / 9}" for x, y, _ in scene.vertices]
    for number, part in enumerate(np.split(scene.faces + 1, 5)):
        lines += [f"o part{number}", f"usemtl m{number % 2}"]
        lines += ["f " + " ".join(f"{corner}/{corner}" for corner in face) for face in part]
    (tmp_path / "boxes.obj").write_text("mtllib m.mtl\n" + "\n".join(lines))
    (tmp_path / "m.mtl").write_text("newmtl m0\nnewmtl m1\n")
    for output in (tmp_path / "cut.glb", tmp_path / "again.glb"):  # from an OBJ, and from a glTF
        given = tmp_path / ("boxes.obj" if output.stem == "cut" else "cut.glb")
        succeeded("bake", given, "-o", output, "--between", 0.1 if output.stem == "cut" else 0.07)
        asset = package.load(output)
        uv = asset.texture_coordinates()
        assert uv == pytest.approx(asset.mesh.vertices[asset.mesh.faces][:, :, :2] / 9, abs=1e-5)
        assert sorted(set(asset.objects)) == [f"part{number}" for number in range(5)]
        materials = {(run.object.name, run.material.name) for run in asset.runs()}
        assert materials == {(f"part{number}", f"m{number % 2}") for number in range(5)}


def test_a_mirrored_instance_keeps_its_front(tmp_path):
    scene = boxes(6)
    document = trimesh.Scene()
    document.add_geometry(scene, "boxes", "boxes")
    mirror = np.diag([-1.0, 1, 1, 1])
    mirror[0, 3] = 20
    document.graph.update(frame_to="mirrored", frame_from="world", matrix=mirror, geometry="boxes")
    document.export(tmp_path / "two.glb")
    succeeded("bake", tmp_path / "two.glb", "-o", tmp_path / "cut.glb", "--between", 0.1)
    mesh = package.load(tmp_path / "cut.glb").mesh
    cut = trimesh.Trimesh(mesh.vertices, mesh.faces)
    assert cut.is_watertight
    assert cut.volume == pytest.approx(2 * scene.volume, rel=1e-5)


def test_a_mesh_that_is_fine_enough_stays(tmp_path):
    ball = trimesh.creation.icosphere(2)
    ball.export(tmp_path / "ball.obj")
    done = succeeded("bake", tmp_path / "ball.obj", "-o", tmp_path / "cut.ply", "--between", 0.02)
    assert f"{len(ball.vertices)} vertices became {len(ball.vertices)}" in done.stdout


def test_a_skin_is_refused(tmp_path):
    (tmp_path / "skinned.glb").write_bytes(skinned())
    result = obscurance("bake", tmp_path / "skinned.glb", "-o", tmp_path / "w.glb", "--between", 0.02)
    refused(result, "skinned.glb: skin: expected none, where faces are cut between vertices, got one")
    assert not (tmp_path / "w.glb").exists()
