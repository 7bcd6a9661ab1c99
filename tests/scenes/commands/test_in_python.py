"""`obscurance.bake`: what the command takes, by the same names, of meshes, files and their names."""

import inspect
import re
import sys
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from mesh_files import obj, ply
from meshes import hills, two_boxes

import obscurance
from obscurance import ao
from obscurance.ao.options import Options, TextureOptions, VertexOptions
from obscurance.raytrace.errors import ConflictError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.opacity import AlphaSurface, Opacity
from obscurance.scenes.bake.options import ROWS, Alpha

BOXES = two_boxes()
FEW = {"samples": 32, "denoise": False}
OUTPUTS = {
    *("mesh", "output", "output_dir", "preset", "colors", "ply_name", "occlusion", "replace_occlusion", "format"),
    *("input_format", "quiet", "report", "debug_image", "resume", "dry_run", "options", "part", "cluster", "shared"),
    "between",
}
"""Options of the command about files that are read or written, and how it runs."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hills.ply").write_bytes(ply(*hills(5)))
    vertices, faces = BOXES
    lines = obj(vertices, faces).decode().splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("f "))
    half = first + len(faces) // 2
    named = [*lines[:first], "o left", *lines[first:half], "o right", *lines[half:]]
    (tmp_path / "boxes.obj").write_text("\n".join(named) + "\n")
    return tmp_path


def test_its_arguments_are_those_of_ao_and_the_options_of_the_command():
    parameters = inspect.signature(obscurance.bake).parameters
    of_ao = inspect.signature(ao.bake).parameters
    assert parameters.keys() >= of_ao.keys() - {"groups"}
    assert parameters.keys() >= {name for name, row in ROWS.items() if "vertices" in row.bake_kinds.split()} - OUTPUTS
    for name in of_ao.keys() - {"groups", "cage"}:
        assert parameters[name].default == of_ao[name].default, name
        assert parameters[name].kind == of_ao[name].kind, name
    for name in parameters.keys() & ROWS.keys() - {*of_ao, "falloff", "progress"} | {"cage"}:
        assert parameters[name].default == ROWS[name].default, name
    text = inspect.getdoc(obscurance.bake)
    assert [name for name in parameters if not re.search(rf"\b{name}\b", text)] == []


def test_a_mesh_its_file_and_the_name_are_baked_to_the_same_bits(folder):
    loaded = obscurance.load("hills.ply")
    w = ao.bake(loaded.mesh, **FEW).w
    for mesh in (loaded, loaded.mesh, ao.prepare(loaded.mesh), "hills.ply", folder / "hills.ply"):
        np.testing.assert_array_equal(obscurance.bake(mesh, **FEW).w, w)


SAME = [
    ({"half_distance": "10%", "max_distance": 2}, ao.Exponential(half_distance="10%", max_distance=2), {}),
    ({"tau": 2.0}, ao.Exponential(2.0), {}),
    ({"falloff": "linear", "max_distance": "30%"}, ao.Linear("30%"), {}),
    ({"falloff": ao.Binary("20%")}, ao.Binary("20%"), {}),
    ({"ground": True}, None, {"occluders": [ao.ground(BOXES)]}),
    ({"ground": -3, "up": "z"}, None, {"occluders": [ao.ground(BOXES, -3, "z")]}),
    ({"occluder": [hills(5)]}, None, {"occluders": [hills(5)]}),
    ({"occluder": hills(5), "ground": -4.0}, None, {"occluders": [hills(5), ao.ground(BOXES, -4.0)]}),
    ({"high": BOXES, "cage": 0.2}, None, {"high": BOXES, "cage": 0.2}),
    ({"at": "faces", "spread": 90}, None, {"at": "faces", "spread": 90}),
    ({"only": np.arange(16) < 8, "both_sides": True}, None, {"only": np.arange(16) < 8, "both_sides": True}),
]


@pytest.mark.parametrize(("options", "falloff", "given"), SAME, ids=lambda each: str(each)[:30])
def test_an_option_does_what_the_command_does_by_it(options, falloff, given):
    np.testing.assert_array_equal(obscurance.bake(BOXES, **FEW, **options).w, ao.bake(BOXES, falloff, **FEW, **given).w)


def test_objects_are_chosen_by_names(folder):
    file = obscurance.load("boxes.obj", names=True)
    left = np.unique(file.mesh.faces[: len(file.mesh.faces) // 2])
    whole = obscurance.bake("boxes.obj", **FEW).w
    np.testing.assert_array_equal(obscurance.bake("boxes.obj", receive="left", **FEW).w[left], whole[left])
    alone = obscurance.bake("boxes.obj", exclude=["right"], max_distance=9, **FEW).w
    assert (alone[left] >= obscurance.bake(file, max_distance=9, **FEW).w[left] - 1e-6).all()
    np.testing.assert_array_equal(alone, obscurance.bake(file, exclude="right", max_distance=9, **FEW).w)
    apart = obscurance.bake("boxes.obj", occluded_by="object", **FEW).w
    assert (apart >= whole - 0.05).all()


REFUSED = [
    ({"max_distance": 2, "falloff": ao.Binary()}, ConflictError, "max_distance needs a falloff by its name"),
    ({"alpha": "non"}, OptionError, "alpha: expected one of auto, ignore, got non"),
    ({"ground": "atuo"}, OptionError, "ground: expected auto, or a height in mesh units, got 'atuo'"),
    ({"progress": "jsn"}, OptionError, "progress: expected one of bar, json, got jsn; did you mean json?"),
    ({"flip": "no"}, OptionError, "flip: expected true or false, got no"),
    ({"points": True}, ConflictError, "points needs the name of a file of points"),
    ({"samples": 0}, OptionError, "samples: expected a whole number from 1 to 1048576, got 0"),
    ({"tolerance": 0}, OptionError, "tolerance: expected a number in [1e-5, 1], got 0"),
    ({"tau": 0}, OptionError, "tau: expected a finite rate above 0, got 0"),
    ({"cage": "2%"}, ConflictError, "cage needs high"),
    ({"high": BOXES, "exclude": "a"}, ConflictError, "exclude and high exclude each other"),
    ({"exclude": "boxes"}, OptionError, "exclude: expected a name or pattern of its objects, mesh, got 'boxes'"),
    ({"exclude": 3}, OptionError, "exclude: expected a list of names or patterns, got 3"),
    ({"only": [True] * 16, "occluded_by": "name"}, ConflictError, "only does not go with occluded_by"),
]


@pytest.mark.parametrize(("options", "kind", "said"), REFUSED, ids=lambda each: str(each)[:40])
def test_what_does_not_fit_is_refused_in_a_line(options, kind, said):
    with pytest.raises(kind, match=re.escape(said)):
        obscurance.bake(BOXES, **options)


CALLS = {
    obscurance.bake: (BOXES,), ao.bake: (BOXES,), ao.bake_points: (BOXES, [[0, 0, 9]], [[0, 0, 1]]),
    ao.bake_texture: (BOXES, np.zeros((16, 2))), Options: (), VertexOptions: (), TextureOptions: (),
}  # fmt: skip


@pytest.mark.parametrize(("function", "arguments"), CALLS.items(), ids=lambda each: getattr(each, "__name__", ""))
def test_a_misspelt_argument_is_told_the_nearest(function, arguments):
    with pytest.raises(OptionError, match=r"^options: smaples: expected one of .*falloff.* did you mean samples\?$"):
        function(*arguments, smaples=16)
    with pytest.raises(OptionError, match=r"options: colour: expected .*, got an unknown name$"):
        function(*arguments, colour=1)
    assert "self" not in inspect.signature(function).parameters
    assert inspect.signature(function).parameters["samples"].default is None


def test_alpha_and_the_up_axis_are_those_of_meshes_in_memory_too():
    vertices, faces = hills(5)
    above = vertices + np.array([0, 0, 2])
    opaque = (above, faces)
    glass = Mesh(*opaque, opacity=Opacity(np.zeros(len(faces), int), (AlphaSurface(0.5),)))
    for name, others in [("mesh", {}), ("occluder", {"mesh": hills(5)})]:
        given = others | FEW | {name: glass}
        open_w, closed_w = (obscurance.bake(**given, alpha=alpha).w for alpha in get_args(Alpha))
        np.testing.assert_array_equal(closed_w, obscurance.bake(**others, **{name: opaque}, **FEW).w)
        assert (open_w > closed_w).any()


@pytest.mark.parametrize("bake", [obscurance.bake, ao.bake])
@pytest.mark.parametrize("kind", [np.array, np.ndarray.tolist])
def test_two_arrays_are_told_to_be_a_pair(bake, kind):
    vertices, faces = BOXES
    with pytest.raises(OptionError, match=re.escape("bake((vertices, faces))")):
        bake(vertices, kind(faces))


def test_a_file_is_shown_in_a_line(folder):
    assert repr(obscurance.load("hills.ply")).startswith("<Asset 'hills.ply': <Mesh 'hills.ply': ")
    assert len(repr(obscurance.load("boxes.obj", names=True))) < 120


def test_progress_is_shown_where_it_is_asked_for(folder, capfd):
    seen = []
    obscurance.bake("hills.ply", progress=lambda *counts: seen.append(counts), **FEW)
    assert seen[-1][0] == seen[-1][1] > 0
    obscurance.bake("hills.ply", **FEW)
    obscurance.bake("hills.ply", progress=True, **FEW)  # no terminal, and less than ten seconds
    assert capfd.readouterr() == ("", "")
    obscurance.bake("hills.ply", progress="json", **FEW)
    assert '"event": "progress"' in capfd.readouterr().err


def test_a_notebook_shows_a_line_that_goes(folder, monkeypatch):
    shown = []

    def display(data, raw, display_id):
        shown.append(data["text/plain"])
        return SimpleNamespace(update=lambda data, raw: shown.append(data["text/plain"]))

    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()), display=None)
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    obscurance.bake("hills.ply", progress=False, **FEW)
    assert shown == []
    obscurance.bake("hills.ply", **FEW)
    assert any(re.fullmatch(r"rays: \d+ %.*", line) for line in shown)
    assert shown[-1] == ""
