"""The wheel: it holds every file of the packages, and runs where it is installed alone; without Embree it says so."""

import os
import re
import shutil
import site
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from importlib.machinery import EXTENSION_SUFFIXES

import numpy as np
import pytest
from command import refused
from mesh_files import obj
from meshes import hills
from project import ROOT

from obscurance.raytrace.kernel import library, processor

PACKAGES = ("raytrace", "ao", "scenes")
WITHOUT_EMBREE = """
import sys
sys.modules["embreex"] = None
from obscurance import cli
cli.main()
"""


def run(*command, folder, **options):
    return subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True, check=False, **options)


def test_building_needs_what_running_and_compiling_need_in_the_same_versions():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    known = project["project"]["dependencies"] + project["project"]["optional-dependencies"]["develop"]
    assert set(project["build-system"]["requires"]) <= set(known)


ONE_MODULE = """

def modules() -> list[str]:
    return ["obscurance.raytrace.kernel.arrays"]
"""
QUIET = ("-m", "pip", "--quiet", "--disable-pip-version-check")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """A wheel that has the kernels of one module alone, made of a copy of this source tree."""
    source = source_in(tmp_path_factory.mktemp("wheel"))
    with (source / "raytrace" / "kernel" / "build.py").open("a") as file:
        file.write(ONE_MODULE)
    return built("wheel", source, source.parent)


@pytest.fixture(scope="module")
def whole_wheel(tmp_path_factory):
    """The wheel with all kernels."""
    source = source_in(tmp_path_factory.mktemp("whole_wheel"))
    if (ROOT / "build").is_dir():  # has most of the object files
        shutil.copytree(ROOT / "build", source / "build", ignore=shutil.ignore_patterns("lib*", "bdist*"))
    return built("wheel", source, source.parent)


def source_in(folder):
    """A copy of this source tree without what was built."""
    source = folder / "source"
    built = shutil.ignore_patterns("__pycache__", *(f"*{suffix}" for suffix in EXTENSION_SUFFIXES))
    for package in ("obscurance", *PACKAGES):
        shutil.copytree(ROOT / package, source / package, ignore=built)
    for name in ("cli.py", "setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    return source


BUILD = "from setuptools import build_meta; print(build_meta.build_{}(r'{}'))"


def built(kind, source, folder):
    """What the build backend makes of a source tree in a folder, as pip asks it to."""
    done = run(sys.executable, "-W", "ignore", "-c", BUILD.format(kind, folder), folder=source)
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.split()[-1]


def test_wheel_and_source_archive_pass_the_check_of_the_index_and_hold_every_file(wheel, tmp_path):
    archive = built("sdist", wheel.parent / "source", tmp_path)
    checked = run(sys.executable, "-m", "twine", "--no-color", "check", "--strict", wheel, archive, folder=tmp_path)
    assert checked.stdout.count("PASSED") == 2, checked.stdout + checked.stderr
    source, made = wheel.parent / "source", {"build", "obscurance.egg-info", "__pycache__"}
    wanted = {path.relative_to(source) for path in source.rglob("*") if path.is_file()}
    with tarfile.open(archive) as packed:
        held = {name.partition("/")[2] for name in packed.getnames()}
    assert {path.as_posix() for path in wanted if not made & set(path.parts)} <= held
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {f"obscurance/{package}/py.typed" for package in PACKAGES} <= names
    assert {f"obscurance/{library.file_of(level).relative_to(ROOT)}" for level in processor.levels()} <= names
    assert wheel.name.endswith(f"{sysconfig.get_platform().replace('-', '_').replace('.', '_')}.whl")


def test_the_wheel_holds_every_file_of_the_package_and_nothing_else_to_import(wheel):
    names = [name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name]
    folders = {ROOT / "obscurance": "obscurance"} | {ROOT / name: f"obscurance/{name}" for name in PACKAGES}
    wanted = [
        f"{target}/{path.relative_to(folder).as_posix()}"
        for folder, target in folders.items()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    built = tuple(EXTENSION_SUFFIXES)
    assert {name for name in names if not name.endswith(built)} == {
        *(name for name in wanted if not name.endswith(built)),
        "obscurance/cli.py",
    }
    assert all(name.startswith("obscurance/") for name in names)


def test_modules_of_other_packages_replace_nothing(wheel, tmp_path):
    """Other packages install a `cli.py` or an `ao`, as several do, and projects have folders named `scenes`."""
    into = (sys.executable, *QUIET, "install", "--no-deps", "--no-index", "--target", tmp_path, wheel)
    done = run(*into, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("cli", "ao", "raytrace"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('taken over')\n")
    (tmp_path / "scenes").mkdir()
    alone = os.environ | {"PYTHONPATH": str(tmp_path)}
    for command in ([tmp_path / "bin" / "obscurance"], [sys.executable, "-m", "obscurance"]):
        done = run(*command, "--version", folder=tmp_path, env=alone)
        assert done.stdout.startswith("obscurance "), done.stdout + done.stderr
    code = "import obscurance; print(obscurance.bake.__module__, obscurance.load.__module__)"
    done = run(sys.executable, "-c", code, folder=tmp_path, env=alone)
    assert done.stdout == "obscurance.scenes.commands.in_python obscurance.scenes.formats.load\n", done.stderr


NO_COMPILER = "import sys\nsys.modules.update(numba=None, llvmlite=None, setuptools=None)\n"


@pytest.fixture(scope="module")
def installed(whole_wheel):
    """The scripts of an environment that has the wheel, and the dependencies of this one but for the compiler, and not
    this source tree."""
    wheel = whole_wheel
    folder = wheel.parent
    environment = folder / "environment"
    run(sys.executable, "-m", "venv", "--without-pip", environment, folder=folder)
    scripts = environment / ("Scripts" if sys.platform == "win32" else "bin")
    into = (sys.executable, *QUIET, "--python", scripts / "python", "install", "--no-deps", "--no-index", wheel)
    done = run(*into, folder=folder)
    assert done.returncode == 0, done.stderr
    (packages,) = environment.rglob("site-packages")
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))  # whose own .pth files are not read
    (packages / "sitecustomize.py").write_text(NO_COMPILER)
    return scripts


@pytest.mark.slow
def test_the_wheel_runs_in_an_environment_of_its_own(installed, tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(5)))
    where = run(
        installed / "python",
        "-c",
        "import obscurance.cli; from obscurance import ao; print(obscurance.cli.__file__, ao.__file__)",
        folder=tmp_path,
    ).stdout
    assert where.count(str(installed.parent)) == 2
    nowhere = {"PATH": "", "HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null", "TMPDIR": str(tmp_path)}
    for line in (
        "--version",
        "info hills.obj",
        "bake hills.obj -o hills.glb --samples 16",
        "bake hills.obj -o hills.png --uv unwrap --mesh-output unwrapped.glb --size 64 --samples 16",
        "bake hills.obj -o fitted.ply --method surface --samples 16",
        "scenes cornell -o cornell.toml",
        "render cornell.toml -o cornell.png --width 64 --height 64",
        "demo -o demo",
    ):
        done = run(installed / "obscurance", *line.split(), folder=tmp_path, env=nowhere)
        assert done.returncode == 0, done.stderr
    for made in ("hills.glb", "hills.png", "fitted.ply", "cornell.toml", "demo/temple.png", "demo/temple.ply"):
        assert (tmp_path / made).stat().st_size > 500


KNOWN = """
from obscurance.raytrace.kernel import library
library.source_identity = None
print(library.results_identity())
"""


@pytest.mark.slow
def test_the_library_of_a_wheel_has_the_identities_of_all_its_sources(installed, tmp_path):
    done = run(installed / "python", "-c", KNOWN, folder=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_every_level_that_this_processor_has_bakes_alike(installed, tmp_path):
    """Fused products are rounded alike; what differs is where sums of lanes are added up."""
    (tmp_path / "hills.obj").write_bytes(obj(*hills(20)))
    baked = []
    for level in processor.levels()[: processor.levels().index(processor.level()) + 1]:
        code = f"from obscurance.raytrace.kernel import processor; processor.level = lambda: {level!r}; "
        code += "import obscurance.cli; obscurance.cli.main()"
        target = tmp_path / f"{level}.npy"
        done = run(installed / "python", "-c", code, "bake", "hills.obj", "-o", target, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        baked.append(np.load(target))
    for w in baked:
        np.testing.assert_allclose(w, baked[0], atol=0.02)


TYPED = """
from typing import assert_type
import numpy as np
import numpy.typing as npt
from obscurance import ao, raytrace, scenes

mesh = scenes.Temple(fineness=0.2).geometry().mesh
assert_type(mesh, raytrace.Mesh)
assert_type(raytrace.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).faces, npt.NDArray[np.int32])
baked = ao.bake(mesh, ao.Exponential(half_distance="50%"), tolerance=0.02)
assert_type(baked, ao.Bake)
assert_type(baked.w, npt.NDArray[np.float64])
texture = ao.bake_texture(mesh, scenes.unwrap(mesh), 64)
assert_type(texture, ao.BakedTexture)
scenes.write("temple.glb", baked, scenes.Asset.of(mesh))
white = raytrace.Object(raytrace.Shape(mesh, raytrace.Lambert(albedo=0.8)), w=baked.w)
camera = raytrace.Camera.framing(mesh, direction=(0.5, 1, 0.8), up=(0, 0, 1), aspect=1.5)
scene = raytrace.Scene((white,), (raytrace.AmbientLight(intensity=0.4),))
assert_type(raytrace.render(scene, camera, raytrace.Settings(width=48)), raytrace.Frame)
ao.bake_texture(mesh, scenes.unwrap(mesh), 64, "binary", normals="aera")
ao.bake(mesh, "binary", 16, smaples=3)
"""


@pytest.mark.slow
def test_a_user_s_script_under_strict_mypy_sees_the_types(installed, tmp_path):
    (tmp_path / "script.py").write_text(TYPED)
    check = ("--strict", "--no-incremental", "--python-executable", installed / "python")
    found = run(sys.executable, "-m", "mypy", *check, "script.py", folder=tmp_path).stdout
    lines, faults = TYPED.count("\n"), re.findall(r":(\d+): error: (.*)  \[", found)
    choices = "Literal['angle', 'area', 'equal', 'file', 'up']"
    assert faults == [
        (str(lines - 1), f"Argument \"normals\" to \"bake_texture\" has incompatible type \"Literal['aera']\"; "
                         f'expected "{choices}"'),
        (str(lines), 'Unexpected keyword argument "smaples" for "bake"; did you mean "samples"?'),
    ], found  # fmt: skip


def test_without_embree_one_line_says_what_to_do(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(5)))
    command = (sys.executable, "-c", WITHOUT_EMBREE, "bake", tmp_path / "hills.obj", "-o", tmp_path / "w.npy")
    refused(run(*command, folder=ROOT), "embreex", "cannot be imported", "pip install", "ARM Linux", status=1)
    assert not (tmp_path / "w.npy").exists()
