"""The declarations of options: what is declared is in the help of the command and of Python, reports, `--options`,
batches and what workers are sent; and each option changes what kept rows belong to, or is one that changes no ray."""

import dataclasses
import inspect
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gltf_files import TRIANGLE, Builder
from meshes import hills
from project import environment

from obscurance import ao
from obscurance.ao.baking import VertexArguments
from obscurance.ao.declared import options_of
from obscurance.ao.execute.kept import Kept, _identity
from obscurance.ao.methods.point_values import TAKEN
from obscurance.ao.options import Options, TextureOptions, VertexOptions
from obscurance.ao.texture.bake_texture import TextureArguments
from obscurance.raytrace.errors import ConflictError
from obscurance.raytrace.system.threads import MAX_THREADS
from obscurance.scenes.bake.options import BAKE, BAKER, ROWS, BakeOptions, check_kind, check_together
from obscurance.scenes.bake.plan import plan_bake
from obscurance.scenes.bake.run import run

ADDED = """
import contextlib, importlib.util, io, json, pathlib, pickle, sys

spec = importlib.util.find_spec("obscurance.ao.options")
source, before = pathlib.Path(spec.origin).read_text(), "    profile: Annotated"
added = '    grain: Annotated[str | None, Option(help="Grain of the wood.")] = None\\n'
assert source.count(before) == 1
sys.modules["obscurance.ao.options"] = module = importlib.util.module_from_spec(spec)
exec(source.replace(before, added + before), vars(module))
from obscurance import ao, cli
from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake

def run(*line):
    sys.argv = ["obscurance", *line]
    streams = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            cli.main()
        except SystemExit as end:
            return end.code, streams[0].getvalue() + streams[1].getvalue()

found = {"help": run("bake", "--help", "all")[1]}
found["identities"] = [repr(module.Options(grain=each).identity) for each in (None, "oak")]
few, oak = ("hills.obj", "--samples", "4"), ("--grain", "oak")
run("bake", *few, *oak, "-o", "w.npy", "--report", "r.json")
run("bake", "-o", "again.npy", "--options", "r.json", "--report", "s.json")
found["report"], found["again"] = (json.load(open(name)) for name in ("r.json", "s.json"))
run("bake", *few, *oak, "--output-dir", "out")
found["resume"] = run("bake", *few, "--output-dir", "out", "--resume")[1]
from pathlib import Path
plan = plan_bake(BakeOptions(mesh=[Path("hills.obj")], output=Path("w.npy"), grain="oak"))
found["sent"] = pickle.loads(pickle.dumps(plan)).options.grain
print(json.dumps(found))
"""


def test_an_option_that_is_declared_in_one_line_is_found_everywhere(tmp_path):
    import json

    (tmp_path / "hills.obj").write_text(obj())
    command = [sys.executable, "-c", ADDED]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False, env=environment()
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    section = found["help"].partition("Sampling:")[2].partition("\n\n")[0]
    assert "--grain TEXT" in section
    assert "Grain of the wood." in section
    assert found["identities"][0] != found["identities"][1]
    for report in (found["report"], found["again"]):
        assert report["options"]["grain"] == "oak"
        assert " --grain oak" in report["command"]
    assert "of other options or another version; starting from the beginning" in found["resume"]
    assert found["sent"] == "oak"


def obj(height=0.0):
    """Hills twice, one above the other and of glass, with the same texture coordinates."""
    vertices, faces = hills(5)
    lines = ["mtllib glass.mtl"]
    for lift in (0.0, 1.0 + height):
        lines += [f"v {x} {y} {z + lift}" for x, y, z in vertices]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    lines += [f"vt {u} {v}" for u, v, _ in (vertices - low) / (high - low)]
    for first, material in ((1, "stone"), (1 + len(vertices), "glass")):
        lines += [f"o {material}", f"usemtl {material}"]
        lines += ["f " + " ".join(f"{first + v}/{1 + v}" for v in face) for face in faces]
    return "\n".join(lines) + "\n"


class Begun(Exception):
    """A bake that has said what it belongs to."""


class Identity(Kept):
    """Says what kept rows would belong to, before anything is traced."""

    def begin(self, placement, receivers, *settings):
        raise Begun(_identity(placement, receivers, settings))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hills.obj").write_text(obj())
    (tmp_path / "other.obj").write_text(obj(0.5))
    copies = Builder()
    triangle = copies.primitive(TRIANGLE)
    triangle["attributes"]["TEXCOORD_0"] = copies.accessor(np.ascontiguousarray(TRIANGLE[:, :2]), "VEC2")
    copies.mesh(triangle)
    (tmp_path / "copies.glb").write_bytes(copies.glb([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}]))
    (tmp_path / "glass.mtl").write_text("newmtl stone\nnewmtl glass\nd 0.5\n")
    return tmp_path


def within(folder, value):
    return [folder / each for each in value] if isinstance(value, list) else folder / value


def identity_of(folder, **options):
    """What kept rows of the bake with these options belong to."""
    given = {"mesh": folder / "hills.obj", "output": folder / "w.npy", "quiet": True} | options
    plan = plan_bake(BakeOptions(**(given | {"mesh": [given["mesh"]]})))
    with pytest.raises(Begun) as begun:
        list(run(plan, open_checkpoint=lambda _: Identity(folder / "w.npy")))
    return begun.value.args[0]


TEXTURE = {"size": "16", "overlap": "mean"}
CHANGED = {
    "samples": 9, "tolerance": 0.1, "falloff": "binary", "tau": 3.0, "half_distance": "20%", "max_distance": "70%",
    "normals": "area", "interior": "ignore", "alpha": "ignore", "method": "surface", "denoise": False,
    "profile": True, "seed": 1, "size": "32", "overlap": "first", "cage": "3%",
    "quiet": False, "threads": 1, "replace_occlusion": True, "error_map": "e.png", "half": True, "debug_image": "d.png",
    "bits": "8", "bent_space": "tangent", "resume": True, "progress": "json", "output_dir": "out", "format": "ply",
    "input_format": "ply", "cluster": "local", "ground": "-9", "options": "r.json",
    "dry_run": True, "back_faces": "ignore", "spread": 90.0, "weight": "uniform", "thickness": True, "flip": True,
    "at": "faces", "both_sides": True,
    "receive": ["stone"], "cast": ["stone"], "exclude": ["glass"],
}  # fmt: skip
"""Of each option another value than that of the bakes below."""
PATHS = {
    "mesh": "other.obj", "high": ["other.obj"], "mesh_output": "m.glb", "bent_normals": "b.exr", "report": "r.json",
    "output": "v.npy", "occluder": ["other.obj"],
}  # fmt: skip
TOGETHER = {
    "texel_size": ({"size": None, "texel_size": "1%"}, {"size": None, "texel_size": "5%"}),
    "uv": ({"mesh_output": "m.glb", "size": "64"}, {"mesh_output": "m.glb", "size": "64", "uv": "unwrap"}),
    "instances": (
        {"mesh": "copies.glb", "overlap": None},
        {"mesh": "copies.glb", "overlap": None, "instances": "first"},
    ),
    "cage": ({"high": ["other.obj"]}, {"high": ["other.obj"], "cage": "9%"}),
    "match_names": (
        {"high": ["other.obj"], "cage": "200%"},
        {"high": ["other.obj"], "cage": "200%", "match_names": True},
    ),
    "between": ({"output": "w.ply"}, {"output": "w.ply", "between": 0.02}),
    "colors": ({"output": "w.ply"}, {"output": "w.ply", "colors": "rgb"}),
    "ply_name": ({"output": "w.ply"}, {"output": "w.ply", "ply_name": "quality"}),
    "up": ({"output": "w.ply"}, {"output": "w.ply", "up": "z"}),
    "preset": ({"output": "w.glb"}, {"output": "w.glb", "preset": "three"}),
    "occlusion": ({"output": "w.glb"}, {"output": "w.glb", "occlusion": "ramp"}),
    "replace_occlusion": ({"output": "w.glb"}, {"output": "w.glb", "replace_occlusion": True}),
    "orm": ({"output": "w.glb", "occlusion": "texture"}, {"output": "w.glb", "occlusion": "texture", "orm": True}),
    "bent_space": ({"bent_normals": "b.exr"}, {"bent_normals": "b.exr", "bent_space": "tangent"}),
    "half": ({"output": "w.exr"}, {"output": "w.exr", "half": True}),
    "profile": ({"output": "w.npz"}, {"output": "w.npz", "profile": True}),
}
"""Of options that need others, the options of two bakes."""
APART = {"occluded_by", "points"}
"""Options of bakes that keep no rows."""


@pytest.mark.parametrize("row", [row for row in BAKE if row.name not in APART], ids=lambda row: row.name)
def test_every_option_changes_what_kept_rows_belong_to_or_is_one_that_changes_no_ray(folder, row):
    if row.name == "uv":
        pytest.importorskip("uvunwrap")
    value = CHANGED.get(row.name) or PATHS.get(row.name, CHANGED.get(row.name))
    one, other = TOGETHER.get(row.name, ({}, {row.name: value}))
    assert other != {row.name: None}, "a new option needs another value here"
    paths = {row.name for row in BAKE if "Path" in str(row.kind)}
    if "vertices" not in row.bake_kinds.split():
        one, other = ({"output": "w.png"} | TEXTURE | options for options in (one, other))
    one, other = (
        {name: within(folder, value) if name in paths and value else value for name, value in options.items()}
        for options in (one, other)
    )
    same = identity_of(folder, **one) == identity_of(folder, **other)
    assert same != (row.role in ("input", "result"))


IN_PYTHON = CHANGED | {
    "falloff": ao.Binary(), "only": [True], "interior": "fill", "wrap": False, "close_seams": False,
}  # fmt: skip
"""Of each option that a record declares another value than the default."""
RECORDS = VertexOptions, TextureOptions


@pytest.mark.parametrize(("record", "name"), [(record, name) for record in RECORDS for name in options_of(record)])
def test_every_declared_option_changes_what_kept_rows_belong_to_or_is_one_that_changes_no_ray(record, name):
    row, changed = options_of(record)[name], record(**{name: IN_PYTHON[name]})
    assert (changed.identity != record().identity) == (row.role == "result")


ARGUMENTS = {ao.bake: VertexArguments, ao.bake_texture: TextureArguments, ao.bake_points: Options}


@pytest.mark.parametrize(("function", "record"), ARGUMENTS.items(), ids=lambda each: each.__name__)
def test_functions_have_the_parameters_and_defaults_of_their_record(function, record):
    parameters = inspect.signature(function).parameters
    fields = {field.name: field for field in dataclasses.fields(record)}
    if function is ao.bake_points:
        kept = {*TAKEN}
        assert parameters.keys() - {"mesh", "points", "normals", "occluders", "progress"} == kept
    else:
        kept = fields.keys()
        assert parameters.keys() == kept
        assert [name for name, each in parameters.items() if each.kind is each.POSITIONAL_OR_KEYWORD] == [
            name for name, field in fields.items() if not field.kw_only
        ]
    for name in kept:
        default = fields[name].default
        assert parameters[name].default == (inspect.Parameter.empty if default is dataclasses.MISSING else default)


@pytest.mark.parametrize("function", [ao.bake, ao.bake_texture])
def test_docstrings_of_functions_begin_as_the_help_of_the_command(function):
    text = inspect.getdoc(function)
    described = dict(re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text.partition("Args:\n")[2], re.MULTILINE))
    for name in inspect.signature(function).parameters:
        assert name in described, f"{name} is not described"
    for name, row in options_of(ARGUMENTS[function]).items():
        words = re.sub("--([a-z-]+)", lambda flag: f"`{flag[1].replace('-', '_')}`", row.help)
        assert " ".join(described[name].split()).startswith(words)
        assert row.help or not row.bake_kinds
    assert text.index("Args:") < text.index("Raises:") < text.index("Warns:")


def test_threads_are_as_many_as_can_work():
    assert BAKER["threads"].bounds == (1, MAX_THREADS)


def test_defaults_are_as_if_they_were_given():
    assert Options(tolerance=0.005).identity == Options().identity
    assert Options(samples=256, denoise=False).identity == Options(denoise=False).identity
    assert Options(samples=256).tolerance is None
    assert Options(threads=1).identity == Options().identity


def test_the_three_forms_of_conflicts():
    for options, said in [
        ({"cage": "2%"}, "cage needs high"),
        ({"size": "64", "texel_size": "1%"}, "texel_size and size exclude each other"),
    ]:
        with pytest.raises(ConflictError, match=f"options: {said}$"):
            check_together(BakeOptions(mesh=[], **options), BAKE)
    for kind, said in {"texture": "does not go with a texture"}.items():
        with pytest.raises(ConflictError, match=f"options: colors {said}$"):
            check_kind(BakeOptions(mesh=[], colors="rgb"), kind)
    said = "^options: thickness does not go with interior='fill', as rays start inside$"
    with pytest.raises(ConflictError, match=said) as fault:
        Options(thickness=True, interior="fill")
    assert (fault.value.first, fault.value.relation) == ("thickness", "does not go with")


def test_relations_name_options_of_the_table():
    for row in BAKE:
        for name in (*row.needs, *row.excludes):
            assert name in ROWS, f"{row.name} needs or excludes {name}"
        assert set(row.bake_kinds.split()) <= {"vertices", "texture", "batch"}


@pytest.mark.parametrize(
    ("given", "profile"),
    [
        ({}, True),
        ({"tolerance": 0.02}, True),
        ({"samples": 64}, True),
        ({"profile": False}, False),
        ({"falloff": "binary"}, False),
        ({"method": "surface"}, False),
        ({"output": Path("w.ply")}, False),
    ],
    ids=str,
)
def test_a_page_has_a_profile_where_it_takes_no_more_rays(given, profile):
    plan = plan_bake(BakeOptions(**{"mesh": [Path("m.obj")], "output": Path("w.html")} | given))
    assert plan.arguments.profile is profile
