"""`obscurance prune`."""

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from gltf_files import Builder, check_glb, values
from mesh_files import obj

from obscurance.scenes.formats.load import load


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
    done = succeeded("prune", "car.glb", "-o", "out.glb")
    assert "out.glb: 24 faces; 92 that nothing outside sees are gone" in done.stdout
    found = trimesh.load_scene("out.glb")
    assert {name: len(part.faces) for name, part in found.geometry.items()} == {"body": 12, "wheel": 12}
    assert found.geometry["body"].visual.material.name == "red"
    assert set(found.graph.nodes_geometry) == {"body", "wheel"}, "the spare wheel goes from its node alone"
    assert (engine / "out.glb").stat().st_size < (engine / "car.glb").stat().st_size - 80 * 3 * 2


def test_faces_that_one_instance_shows_stay_in_all(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = trimesh.Scene()
    pair = trimesh.util.concatenate([trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1))])
    half = pair.copy()
    half.apply_translation([5, 0, 0])
    scene.add_geometry(pair, geom_name="closed")
    scene.graph.update(
        "again", "world", geometry="closed", matrix=trimesh.transformations.translation_matrix([9, 0, 0])
    )
    scene.export("pair.glb")
    assert obscurance("prune", "pair.glb", "-o", "out.glb").stdout.startswith("out.glb: 24 faces; 24 that")
    assert len(trimesh.load_scene("out.glb").graph.nodes_geometry) == 2


def glass_box(alpha):
    box = trimesh.creation.box((2, 2, 2))
    mode = "BLEND" if alpha < 255 else "OPAQUE"
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, alpha], alphaMode=mode)
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=material)
    scene = trimesh.Scene()
    scene.add_geometry(box, geom_name="body")
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=0, radius=0.5), geom_name="engine")
    return scene


@pytest.mark.parametrize(("alpha", "kept"), [(60, 32), (255, 12)])
@pytest.mark.parametrize("ending", ["glb", "ply"])
def test_what_stands_behind_glass_is_seen(tmp_path, monkeypatch, alpha, kept, ending):
    monkeypatch.chdir(tmp_path)
    glass_box(alpha).export("box.glb")
    assert f": {kept} faces" in obscurance("prune", "box.glb", "-o", f"out.{ending}").stdout
    assert sum(len(part.faces) for part in trimesh.load_scene(f"out.{ending}").geometry.values()) == kept


def test_a_document_keeps_what_is_no_face_of_its_scene(tmp_path, monkeypatch):
    """Nodes without a mesh, lines, another scene's mesh, morph targets, cameras and animations."""
    monkeypatch.chdir(tmp_path)
    builder = Builder()
    corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    shell = builder.primitive(corners * 8 - 1, faces)
    core = builder.primitive(corners, faces)
    shell["targets"] = [{"POSITION": builder.accessor(corners * 0, "VEC3")}]
    edge = {**core, "indices": builder.accessor(np.uint16([0, 1]), "SCALAR"), "mode": 1}
    builder.mesh(shell, {**core, "targets": shell["targets"]}, name="shell")
    builder.mesh(dict(core), name="core")
    builder.mesh(dict(core), edge, name="wire")
    builder.mesh(dict(core), name="elsewhere")
    nodes = [{"name": "root", "children": [1, 2, 3, 4]}, {"mesh": 0, "weights": [0.0]}, {"mesh": 1, "name": "hidden"}]
    nodes += [{"mesh": 2}, {"mesh": 3}, {"mesh": 3, "name": "of the other scene"}, {"camera": 0}]
    cameras = [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]
    times = builder.accessor(np.float32([0, 1]), "SCALAR", min=[0], max=[1])
    moves = builder.accessor(np.float32([[0, 0, 0], [0, 1, 0]]), "VEC3")
    channels = [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]
    animations = [{"samplers": [{"input": times, "output": moves}], "channels": channels}]
    content = builder.glb(nodes, cameras=cameras, animations=animations, scenes=[{"nodes": [0, 6]}, {"nodes": [5]}])
    (tmp_path / "in.glb").write_bytes(content)
    done = obscurance("prune", "in.glb", "-o", "out.glb")
    assert done.stdout.startswith("out.glb: 4 faces; 16 that"), done
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    assert [mesh["name"] for mesh in header["meshes"]] == ["shell", "wire", "elsewhere"]
    assert [len(mesh["primitives"]) for mesh in header["meshes"]] == [1, 1, 1]
    assert [node.get("mesh") for node in header["nodes"]] == [None, 0, None, 1, None, 2, None]
    assert header["nodes"][2] == {"name": "hidden"}
    assert header["cameras"] == cameras
    assert header["animations"] == animations
    np.testing.assert_array_equal(values(header, binary, moves), [[0, 0, 0], [0, 1, 0]])
    assert len(header["meshes"][0]["primitives"][0]["targets"]) == 1


FAR = np.array([500_000.1, 5_000_000.25, 123.456789012345])


@pytest.mark.parametrize("ending", ["ply", "obj", "off"])
@pytest.mark.parametrize("scale", [1.0, 1e60])
def test_all_digits_of_vertices_are_kept(tmp_path, ending, scale):
    box = trimesh.creation.box().subdivide()
    vertices = scale * (box.vertices / 3 + FAR)
    (tmp_path / "m.obj").write_bytes(obj(vertices, box.faces))
    succeeded("prune", tmp_path / "m.obj", "-o", tmp_path / f"out.{ending}")
    mesh = load(tmp_path / f"out.{ending}").mesh
    np.testing.assert_array_equal(mesh.vertices, load(tmp_path / "m.obj").mesh.vertices)
    np.testing.assert_array_equal(mesh.faces, box.faces)


def test_an_stl_is_refused_if_float32_moves_its_vertices(tmp_path):
    box = trimesh.creation.box()
    (tmp_path / "near.obj").write_bytes(obj(box.vertices / 3, box.faces))
    succeeded("prune", tmp_path / "near.obj", "-o", tmp_path / "near.stl")
    stored = trimesh.load(tmp_path / "near.stl")
    np.testing.assert_allclose(stored.triangles, (box.vertices / 3)[box.faces], atol=1e-7)
    np.testing.assert_allclose(stored.face_normals, box.face_normals, atol=1e-6)
    for name, vertices in (("far", box.vertices + FAR), ("huge", 1e60 * box.vertices)):
        (tmp_path / f"{name}.obj").write_bytes(obj(vertices, box.faces))
        refused(obscurance("prune", tmp_path / f"{name}.obj", "-o", tmp_path / f"{name}.stl"), "vertices move by")
        assert not (tmp_path / f"{name}.stl").exists()


def test_what_is_not_kept_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    (tmp_path / "plain.obj").write_text(quad + "f 1 2 3\nf 1 3 4\n")
    (tmp_path / "full.obj").write_text(quad + "vt 0 0\ns 1\nf 1/1 2/1 3/1 4/1\ns 2\nf 1/7 2/1 3/1\nf 1 2\n")
    notes = "warning: full.obj: 1 of 7 indices of vt", "warning: full.obj: 1 faces of fewer than three corners"
    kept = "note: w.glb: not kept from full.obj: smoothing groups, polygons, which become triangles"
    bare = "note: w.stl: not kept from full.obj: all but vertices and triangles, which only a .glb keeps"
    for name, output, lines in (
        ("full.obj", "w.glb", (*notes, kept)), ("full.obj", "w.stl", (*notes, bare)),
        ("plain.obj", "w.glb", ()), ("plain.obj", "w.stl", ()),
    ):  # fmt: skip
        told = succeeded("prune", name, "-o", output, "--quiet").stderr
        assert all(line in told for line in lines), told
        assert told.count("\n") == len(lines)


@pytest.fixture(scope="module")
def lidless(tmp_path_factory):
    """The folder of a box without its lid, in it one ball of which the lower half is unseen, and another in a closed
    case; and how many faces each has."""
    folder = tmp_path_factory.mktemp("lidless")
    scene = trimesh.Scene()
    box = trimesh.creation.box((4, 4, 4))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.9)
    case = trimesh.creation.box((1, 1, 1))
    core = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
    aside = (1.4, 1.4, -1.4)
    for name, mesh, at in (
        ("box", box, (0, 0, 0)),
        ("ball", ball, (0, 0, -1)),
        ("case", case, aside),
        ("core", core, aside),
    ):
        place = trimesh.transformations.translation_matrix(at)
        scene.add_geometry(mesh, geom_name=name, node_name=name, transform=place)
    scene.export(folder / "box.glb")
    return folder, {"box": len(box.faces), "ball": len(ball.faces), "case": len(case.faces)}


@pytest.fixture(scope="module")
def seen(lidless):
    return kept(lidless[0])


def kept(folder, *options):
    """How many faces of each object stay, and what is said."""
    done = succeeded("prune", folder / "box.glb", "-o", folder / "seen.glb", *options)
    scene = trimesh.load(folder / "seen.glb")
    return {name: len(mesh.faces) for name, mesh in scene.geometry.items()}, done.stdout


def test_parts_and_objects_of_which_something_is_seen_stay_whole(lidless, seen):
    (folder, whole), (faces, said) = lidless, seen
    assert faces["ball"] < whole["ball"]
    assert f"ball ({whole['ball'] - faces['ball']} of {whole['ball']} faces, " in said
    assert "core (80 faces, " in said
    for by in ("parts", "objects"):
        faces, said = kept(folder, "--by", by)
        assert faces == whole, by
        assert "; 80 that nothing outside sees are gone: core (80 faces, " in said


def test_what_is_gone_has_its_bound_by_the_rule_of_three(lidless, seen):
    """The least sure comes first; a bound is 3 over the rays of all faces that are gone."""
    from obscurance import ao

    source = load(lidless[0] / "box.glb")
    unseen = ao.unseen_faces(source.mesh)
    said = seen[1].partition("are gone: ")[2]
    of, names = source.objects_of_faces
    bounds = {}
    for number, name in enumerate(names):
        faces = unseen.faces & (of == number)
        if faces.any():
            bounds[name] = 3 / unseen.rays[faces].sum()
            assert f"{bounds[name]:.1g})" in said.partition(f"{name} (")[2]
    order = sorted(bounds, key=bounds.get, reverse=True)
    assert [part.split(" (")[0] for part in said.split("), ")] == order


def test_what_is_seen_from_above(tmp_path, monkeypatch):
    """A box on a table: the table's underside goes, by the axis that is up; and what stands under it stays by its
    sides."""
    monkeypatch.chdir(tmp_path)
    table = trimesh.creation.box((4, 4, 0.2)).apply_translation([0, 0, 2])
    stool = trimesh.creation.box((1, 1, 1))
    trimesh.util.concatenate([table, stool]).export("room.stl")
    for up, count in (("z", 24 - 4), ("x", 24 - 4)):
        succeeded("prune", "room.stl", "-o", "seen.stl", "--from", "above", "--up", up)
        left = trimesh.load("seen.stl")
        assert len(left.faces) == count
        assert left.face_normals[:, "xyz".index(up)].min() > -0.9
    succeeded("prune", "room.stl", "-o", "seen.glb", "--from", "above", "--up", "z")
    assert len(trimesh.load_mesh("seen.glb").faces) == 20
    refused(obscurance("prune", "room.stl", "-o", "seen.stl", "--from", "below"), "prune --from", "outside, above")


def test_neighbours_of_seen_faces_stay(lidless, seen):
    folder, whole = lidless
    one, many = (kept(folder, "--keep-neighbours", rings)[0]["ball"] for rings in (1, 20))
    assert seen[0]["ball"] < one < many == whole["ball"]
