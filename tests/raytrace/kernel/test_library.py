"""The library of kernels: unchanged kernels come from it, edited ones are compiled, without either a line says so."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from project import ROOT

from obscurance.raytrace.kernel import build, library, processor
from obscurance.raytrace.kernel.identity import kernel_identity

HELPER = """
from .kernel.jit import inline

@inline
def constant():
    return {value}

@inline
def unused():
    return 3
"""
KERNEL = """
from .helper import constant
from .kernel.jit import kernel

@kernel
def answer() -> int:
    return constant()
"""
ANSWER = """
import sys
from obscurance.raytrace.errors import KernelError
from obscurance.raytrace.kernel.jit import compiled
from obscurance.raytrace.loop import answer
try:
    print(answer(), len(compiled), "numba" in sys.modules)
except KernelError as missing:
    print(missing)
"""
PROJECT = '[project]\nname = "small"\nversion = "1"\n[tool.setuptools]\npackages = []\n'


def run(folder, code, **environment):
    """What the code prints. Python's own cache, which takes edits of one second for one, is left out."""
    return subprocess.run(
        [sys.executable, "-B", "-c", code],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout.strip()


def project_in(folder):
    package = folder / "raytrace"
    package.mkdir()
    (folder / "ao").mkdir()
    (package / "__init__.py").touch()
    left_out = shutil.ignore_patterns("vector.py", "arrays.py", "*.so", "*.pyd", "__pycache__")
    shutil.copytree(ROOT / "raytrace" / "kernel", package / "kernel", ignore=left_out)
    for name in ("types.py", "errors.py"):
        shutil.copy(ROOT / "raytrace" / name, package)
    shutil.copy(ROOT / "setup.py", folder)
    (folder / "obscurance").mkdir()
    for name in ("__init__.py", "__init__.pyi"):
        shutil.copy(ROOT / "obscurance" / name, folder / "obscurance")
    (folder / "pyproject.toml").write_text(PROJECT)
    (package / "helper.py").write_text(HELPER.format(value=1))
    (package / "loop.py").write_text(KERNEL)
    return folder


def build_in(folder):
    """What building the library of a project says."""
    command = [sys.executable, "-B", "setup.py", "--quiet", "build_ext", "--inplace"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, timeout=120).stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A project whose only kernel is in its library."""
    pytest.importorskip("setuptools", reason="pip install '.[develop]'")
    folder = project_in(tmp_path_factory.mktemp("built"))
    assert "kernels: 1 built" in build_in(folder)
    return folder


@pytest.fixture
def project(built, tmp_path):
    return shutil.copytree(built, tmp_path / "project")


HARMLESS = [
    ("loop.py", "def answer() -> int:", 'def answer() -> float:\n    """A docstring."""'),
    ("loop.py", "@kernel", "# a comment\n\n@kernel"),
    ("helper.py", "return 3", "return 4"),
    ("kernel/lanes.py", '"""Numba\'s side', '"""# A docstring.\nNumba\'s side'),
    ("kernel/compiler.py", "def shared_object_file", "# a comment\n\ndef shared_object_file"),
]


def edit(project, file, before, after):
    path = project / "raytrace" / file
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))


def test_edits_that_change_no_instruction_compile_nothing(project):
    for each in HARMLESS:
        edit(project, *each)
    assert run(project, ANSWER) == "1 0 False"


@pytest.mark.parametrize(
    ("file", "before", "after", "runs"),
    [
        ("helper.py", "return 1", "return 2", "2 1 True"),
        (
            "helper.py",
            "@inline\ndef constant():\n    return 1",
            "ONE = 1\n@inline\ndef constant():\n    return ONE",
            "1 1 True",
        ),
        ("kernel/lanes.py", "INDEX = ir.IntType(32)", "INDEX = ir.IntType(64)", "1 1 True"),
    ],
)
def test_an_edit_compiles_what_it_touches(project, file, before, after, runs):
    edit(project, file, before, after)
    assert run(project, ANSWER) == runs


def test_building_again_compiles_what_was_edited_alone(project):
    assert "built" not in build_in(project)
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=2))
    assert "kernels: 1 built" in build_in(project)
    assert run(project, ANSWER) == "2 0 False"
    assert len(list((project / "build").rglob("*answer*.o"))) == 1


TYPED = (
    KERNEL
    + """
from .types import Float64s

@kernel
def double(values: Float64s | None, factor: float) -> float:
    return factor if values is None else values[0] * factor
"""
)
CALL = """
import numpy as np
from obscurance.raytrace.errors import KernelError
from obscurance.raytrace.kernel.jit import compiled
from obscurance.raytrace.loop import double
for values in (np.full(1, 3.0), None, np.full(1, 3), np.zeros((2, 2)), np.ones(4)[::2]):
    try:
        print(double(values, 2.0), len(compiled))
    except KernelError as refused:
        print(refused)
"""


@pytest.mark.parametrize(("builds", "installed"), [(True, True), (False, False)])
def test_a_kernel_is_built_for_the_types_it_is_annotated_with_and_refuses_others(project, builds, installed):
    """In a source tree, where it may be compiled when it is called, as where it is installed."""
    (project / "raytrace" / "loop.py").write_text(TYPED)
    if builds:
        assert "kernels: 2 built" in build_in(project)
    if installed:
        (project / "pyproject.toml").unlink()
    refused = [
        f"obscurance.raytrace.loop.double: values: expected <f8:1C or None, got {got}"
        for got in ("<i8:1C", "<f8:2C", "<f8:1A")
    ]
    assert run(project, CALL).splitlines() == ["6.0 0", "2.0 0"] * builds + ["6.0 1", "2.0 2"] * (not builds) + refused
    assert run(project, NO_NUMBA + CALL).splitlines()[2:] == refused


def test_what_is_installed_is_not_compared_with_its_sources(project):
    """An interpreter of a later patch may have other instructions for the same source."""
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=2))
    (project / "pyproject.toml").unlink()
    assert run(project, ANSWER) == "1 0 False"
    assert (
        run(project, "from obscurance.raytrace.kernel.library import compare_sources; compare_sources()" + ANSWER)
        == "2 1 True"
    )


NO_NUMBA = "import importlib.util; importlib.util.find_spec = lambda name: None\n"


def test_without_numba_a_line_says_what_is_missing_and_how_it_is_had(project):
    assert run(project, NO_NUMBA + ANSWER) == "1 0 False"
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=2))
    said = run(project, NO_NUMBA + ANSWER)
    assert said.startswith("obscurance.raytrace.loop.answer: expected a kernel of the library")
    assert "pip install numba`" in said
    assert len(said.splitlines()) == 1


OLD = "from obscurance.raytrace.kernel import processor; processor.cpu_features = lambda: frozenset({'SSE2'})\n"


def test_a_processor_that_no_library_is_for_gets_a_line_with_the_way_to_build_one(project):
    if processor.level() == processor.ARM:
        pytest.skip("x86-64 has levels")
    said = run(project, NO_NUMBA + OLD + ANSWER)
    assert said.startswith("kernels: expected those for this processor (")
    assert "x86-64, below x86-64-v3 (AVX2, FMA)), got none; in the source folder `python -m pip install .`" in said
    assert run(project, OLD + ANSWER) == "1 1 True"


def test_the_level_is_the_best_that_a_processor_has_all_of(monkeypatch):
    if processor.level() == processor.ARM:
        pytest.skip("x86-64 has levels")
    third = {"AVX2", "FMA3"}
    fourth = third | {"AVX512F", "AVX512BW", "AVX512CD", "AVX512DQ", "AVX512VL"}
    for features, level in ((fourth, "x86-64-v4"), (fourth - {"AVX512VL"}, "x86-64-v3"), ({"AVX2"}, "x86-64")):
        monkeypatch.setattr(processor, "cpu_features", lambda has=features: frozenset(has))
        assert processor.level.__wrapped__() == level


def test_the_library_of_this_tree_has_all_kernels():
    """Kernels that were edited since are compiled whenever they are used."""
    entries = [entry for module in build.modules() for entry in build.entries(module)]
    assert len(entries) > 100
    stale = [e.signature.line for e in entries if library.find(e.signature.symbol, e.function) is None]
    assert not stale, f"run `make install`: {stale}"


def test_constants_that_a_kernel_refers_to_are_part_of_its_identity():
    """Each namespace has the same function beside other values."""
    source = "def f(x):\n    return helper(x) + C[0] + np.sqrt(x)\ndef helper(x):\n    return x * D"
    found = []
    for one, other in (((1.0,), 2), ((1.0,), 3), ((1,), 2), ((1.0, 2.0), 2), (np.ones(1), 2), (np.ones(1, np.int8), 2)):
        names = {"C": one, "D": other, "np": np}
        exec(source, names)
        found.append(kernel_identity(names["f"]))
    assert len(set(found)) == len(found)
    exec("\n\n" + source.replace("(x):", "(x: float) -> float:\n    'A docstring.'"), names)
    assert kernel_identity(names["f"]) == found[-1]


RESULTS = "from obscurance.raytrace.kernel.library import results_identity; print(results_identity())"


def test_an_edit_of_what_reads_and_writes_files_leaves_the_identity_of_results(project):
    """Docstrings and readers are edited, then a constant that decides bits."""
    (project / "raytrace" / "text.py").write_text("SEPARATOR = 1\n")
    before = run(project, RESULTS)
    (project / "raytrace" / "text.py").write_text("SEPARATOR = 2\n")
    (project / "raytrace" / "loop.py").write_text('"""Docstring."""\n' + KERNEL)
    assert run(project, RESULTS) == before
    (project / "ao" / "estimate.py").write_text("RAYS = 2\n")
    assert run(project, RESULTS) != before


COMPILED = """
from obscurance.raytrace.kernel import library
made = []
library.source_identity = lambda text, make=library.source_identity: made.append(text) or make(text)
print(library.results_identity(), len(made))
"""


def test_the_identity_of_results_is_made_of_edited_sources_alone(project):
    """Sources are compiled that the library was not built with; without a library, all, with the same result."""
    identity, made = run(project, COMPILED).split()
    assert made == "0"
    comment = project / "raytrace" / "helper.py"
    comment.write_text("# a comment\r\n" + comment.read_text())
    assert run(project, COMPILED) == f"{identity} 1"
    (project / library.file_of(processor.level()).relative_to(ROOT)).unlink()
    unknown, made = run(project, COMPILED).split()
    assert unknown == identity
    assert int(made) == len(list((project / "raytrace").rglob("*.py")))


HAIR = """
import numpy as np
from obscurance import ao
from obscurance.raytrace.kernel import jit
random = np.random.default_rng(5)
along = np.array([0.3, 1.0, 0.2]) + random.normal(0, 0.002, (600, 3))
sides = np.cross(along, random.normal(size=(600, 3)))
sides *= 0.0005 / np.linalg.norm(sides, axis=1)[:, None]
roots = 0.05 * random.uniform(-1, 1, (600, 3))
mesh = np.stack([roots, roots + sides, roots + along], 1).reshape(-1, 3), np.arange(1800).reshape(-1, 3)
cells = np.stack(np.divmod(np.arange(600), 25), -1)[:, None]
uv = (cells + [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]) / 25
ao.bake_texture(mesh, uv, 64, samples=2)
oriented = [line for line in jit.loaded if "bvh16.BVH16( <f4:3C <i4:2C <f4:3C <i8:1C <f4:3C )" in line]
print(sorted(line.split()[0].rpartition(".")[2] for line in oriented), jit.compiled)
"""


def test_slivers_side_by_side_whose_boxes_are_oriented_are_baked_without_numba():
    command = [sys.executable, "-c", NO_NUMBA + HAIR]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "['_find_smooth', '_search', '_search', 'gather_hemispheres'] []\n"
