"""The kernel cache: stale kernels never run, read-only places are no obstacle."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from project import ROOT

from raytrace.kernel import cache
from raytrace.kernel.identity import kernel_identity

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
def answer():
    return constant()
"""


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


@pytest.fixture
def project(tmp_path):
    return project_in(tmp_path)


def project_in(folder):
    package = folder / "raytrace"
    package.mkdir()
    (folder / "ao").mkdir()
    (package / "__init__.py").touch()
    shutil.copytree(ROOT / "raytrace" / "kernel", package / "kernel", ignore=shutil.ignore_patterns("vector.py"))
    shutil.copy(ROOT / "raytrace" / "types.py", package)
    (package / "helper.py").write_text(HELPER.format(value=1))
    (package / "loop.py").write_text(KERNEL)
    return folder


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The cache of a project whose kernel has been compiled, by a user who lets everyone write."""
    folder = project_in(tmp_path_factory.mktemp("compiled"))
    assert run(folder, "import os; os.umask(0)\n" + ANSWER, NUMBA_CACHE_DIR=str(folder / "cache")) == "1 1 True"
    return folder / "cache"


@pytest.fixture
def filled(project, compiled):
    """The same of this project, which has the same sources."""
    return shutil.copytree(compiled, project / "cache")


ANSWER = """
import sys
from raytrace.kernel.jit import compiled
from raytrace.loop import answer
print(answer(), len(compiled), "numba" in sys.modules)
"""


def test_an_edit_in_another_file_reaches_the_kernel(project, filled):
    cache = str(filled)
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 0 False"
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=2))
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "2 1 True"


@pytest.mark.parametrize(
    ("file", "before", "after", "runs"),
    [
        ("loop.py", "def answer():", 'def answer() -> int:\n    """A docstring."""', "1 0 False"),
        ("loop.py", "@kernel", "# a comment\n\n@kernel", "1 0 False"),
        ("helper.py", "return 3", "return 4", "1 0 False"),
        ("kernel/lanes.py", '"""Numba\'s side', '"""The side', "1 0 False"),
        ("loop.py", "constant()", "constant() + 1", "2 1 True"),
        (
            "helper.py",
            "@inline\ndef constant():\n    return 1",
            "ONE = 1\n@inline\ndef constant():\n    return ONE",
            "1 1 True",
        ),
        ("kernel/lanes.py", "INDEX = ir.IntType(32)", "INDEX = ir.IntType(64)", "1 1 True"),
    ],
)
def test_an_edit_compiles_what_it_touches(project, filled, file, before, after, runs):
    path = project / "raytrace" / file
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(filled)) == runs


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


def test_an_edit_of_what_reads_and_writes_files_leaves_the_identity_of_results(project):
    """Docstrings and readers are edited, then a constant that decides bits."""
    code = "from raytrace.kernel.identity import results_identity; print(results_identity())"
    (project / "raytrace" / "text").mkdir()
    (project / "raytrace" / "text" / "lines.py").write_text("SEPARATOR = 1\n")
    before = run(project, code)
    (project / "raytrace" / "text" / "lines.py").write_text("SEPARATOR = 2\n")
    (project / "raytrace" / "loop.py").write_text('"""Docstring."""\n' + KERNEL)
    assert run(project, code) == before
    (project / "ao" / "estimate.py").write_text("RAYS = 2\n")
    assert run(project, code) != before


WHERE = "from raytrace.kernel.cache import cache_folder; print(cache_folder().parent)"


def test_a_cache_that_cannot_be_written_is_passed_over(project):
    blocked = project / "file"
    blocked.touch()
    nowhere = {"NUMBA_CACHE_DIR": str(blocked / "x"), "XDG_CACHE_HOME": str(blocked), "TMPDIR": str(project)}
    assert run(project, WHERE, **nowhere | {"XDG_CACHE_HOME": str(project)}) == str(project / "obscurance")
    assert Path(run(project, WHERE, **nowhere)).parent == project
    assert run(project, ANSWER, **nowhere) == "1 1 True"


def test_the_cache_is_in_the_users_folder_of_caches_unless_another_is_chosen(project):
    chosen, home = project / "chosen", project / "home"
    users = {"linux": ".cache/obscurance", "darwin": "Library/Caches/obscurance"}.get(sys.platform)
    if users is None:
        pytest.skip("no home folder to set")
    nothing = {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": "", "HOME": str(home)}
    assert run(project, WHERE, **nothing) == str(home / users)
    assert run(project, WHERE, **nothing | {"NUMBA_CACHE_DIR": str(chosen)}) == str(chosen)


NO_TEMPORARY_FOLDER = "import tempfile; tempfile.tempdir = '/dev/null/x'; "


@pytest.mark.skipif(os.name != "posix", reason="/dev/null")
def test_without_any_place_for_a_cache_kernels_are_compiled_anew(project):
    nowhere = {"NUMBA_CACHE_DIR": "/dev/null/x", "XDG_CACHE_HOME": "", "HOME": "/dev/null"}
    code = "from raytrace.kernel.cache import cache_folder; print(cache_folder())"
    assert run(project, NO_TEMPORARY_FOLDER + code, **nowhere) == "None"
    assert run(project, NO_TEMPORARY_FOLDER + ANSWER, **nowhere) == "1 1 True"


@pytest.mark.skipif(os.name != "posix", reason="numbers of users")
def test_a_user_without_name_and_home_has_a_cache(project):
    stranger = "import getpass, os, pathlib, pwd; [os.environ.pop(n, 0) for n in ('HOME', 'LOGNAME', 'USER')]; "
    stranger += "[os.environ.pop(n, 0) for n in ('LNAME', 'USERNAME', 'XDG_CACHE_HOME', 'NUMBA_CACHE_DIR')]; "
    stranger += "os.getuid = lambda: 12345; "
    assert run(project, stranger + WHERE, TMPDIR=str(project)) == str(project / "obscurance-12345")


def test_a_full_disk_is_passed_over(project):
    full = "import shutil; before = shutil.disk_usage; "
    full += "shutil.disk_usage = lambda f: before(f)._replace(free=5 if f.name == 'full' else 1 << 30); "
    places = {"NUMBA_CACHE_DIR": str(project / "full"), "XDG_CACHE_HOME": str(project)}
    assert run(project, full + WHERE, **places) == str(project / "obscurance")


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (50, 50)); "


@pytest.mark.skipif(os.name != "posix", reason="limits")
def test_a_disk_that_fills_while_kernels_are_written_is_no_obstacle(project):
    cache = project / "cache"
    assert run(project, FULL + ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 1 True"
    assert not [path for path in cache.rglob("*") if path.is_file() and path.stat().st_size]
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 0 False"


def test_half_a_file_in_the_cache_is_passed_over(project, filled):
    (path,) = (path for path in filled.rglob("*") if path.is_file())
    os.truncate(path, path.stat().st_size - 1)
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(filled)) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(filled)) == "1 0 False"


def test_another_setting_of_numba_or_another_processor_has_kernels_of_its_own(project, filled):
    cache = str(filled)
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache, NUMBA_OPT="1") == "1 1 True"
    elsewhere = "import llvmlite.binding; llvmlite.binding.get_host_cpu_name = lambda: 'another'\n" + ANSWER
    assert run(project, elsewhere, NUMBA_CACHE_DIR=cache) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 0 False"


STRANGER = 65534


def kernel_file(project, folder, printed):
    """The file of the project's only kernel, compiled into an empty cache."""
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(folder)) == printed
    (path,) = (path for path in folder.rglob("*") if path.is_file())
    return path


@pytest.mark.skipif(os.name != "posix", reason="owners and modes")
def test_a_kernel_that_another_user_has_planted_is_not_run(project):
    """In the temporary folder, by the name that a user without a home looks for: it would answer 666."""
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=666))
    planted = kernel_file(project, project / "attack", "666 1 True").read_bytes()[cache._CHECKSUM :]
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=1))
    name = kernel_file(project, project / "honest", "1 1 True").name
    homeless = {"HOME": "/dev/null", "XDG_CACHE_HOME": "", "NUMBA_CACHE_DIR": "", "TMPDIR": str(project)}
    folder = Path(run(project, "from raytrace.kernel.cache import cache_folder; print(cache_folder())", **homeless))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(cache._checksum(name, planted) + planted)
    for path in (folder / name, folder, folder.parent):
        os.chmod(path, 0o755)
    assert run(project, ANSWER, **homeless) == "666 0 False"  # were it the user's own, it would be run
    for path in (folder / name, folder, folder.parent):
        os.chown(path, STRANGER, STRANGER) if os.geteuid() == 0 else os.chmod(path, 0o777)
    assert run(project, ANSWER, **homeless) == "1 1 True"


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A kernel's file, its folder and that folder's parent."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    cache._places.cache_clear()
    cache.cache_folder.cache_clear()
    cache.write_code("some.kernel", b"code")
    assert cache.read_code("some.kernel") == b"code"
    file = cache.cache_folder() / "some.kernel"
    yield file, file.parent, tmp_path / "kernels"
    cache._places.cache_clear()
    cache.cache_folder.cache_clear()


def test_code_of_another_length_is_not_read(kept):
    content = kept[0].read_bytes()
    for length in range(len(content)):
        kept[0].write_bytes(content[:length])
        assert cache.read_code("some.kernel") is None
    kept[0].write_bytes(content + b"0")
    assert cache.read_code("some.kernel") is None


@pytest.mark.skipif(os.name != "posix", reason="owners and modes")
@pytest.mark.parametrize("level", [0, 1, 2])
def test_code_that_others_could_have_written_is_not_read(kept, level):
    for mode in (0o757, 0o775, 0o777):
        kept[level].chmod(mode)
        assert cache.read_code("some.kernel") is None
        cache.cache_folder.cache_clear()
        assert level == 0 or kept[2] not in cache.cache_folder().parents
    kept[level].chmod(0o755)
    assert cache.read_code("some.kernel") == b"code"
    if os.geteuid() == 0:
        os.chown(kept[level], STRANGER, STRANGER)
        assert cache.read_code("some.kernel") is None


@pytest.mark.skipif(os.name != "posix", reason="links")
@pytest.mark.parametrize("level", [0, 1, 2])
def test_code_behind_a_link_is_not_read(kept, level, tmp_path):
    kept[level].rename(tmp_path / "elsewhere")
    kept[level].symlink_to(tmp_path / "elsewhere")
    assert cache.read_code("some.kernel") is None


def test_code_by_the_name_of_another_kernel_is_not_read(kept):
    shutil.copyfile(kept[0], kept[1] / "another.kernel")
    assert cache.read_code("another.kernel") is None


def test_kernels_of_a_folder_that_cannot_be_written_are_run(project, filled):
    """An image's, filled by root."""
    elsewhere = {"NUMBA_CACHE_DIR": str(filled), "XDG_CACHE_HOME": str(project / "mine")}
    no_space = "import shutil; full = shutil.disk_usage('/')._replace(free=0); before = shutil.disk_usage; "
    no_space += "shutil.disk_usage = lambda f: full if f.name == 'cache' else before(f)\n"
    assert run(project, no_space + WHERE, **elsewhere).startswith(str(project / "mine"))
    assert run(project, no_space + ANSWER, **elsewhere) == "1 0 False"


def test_a_chosen_folder_is_filled_whatever_the_users_holds(project, filled):
    places = {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": str(project / "mine")}
    filled.rename(users := Path(run(project, WHERE, **places)))
    assert users == project / "mine" / "obscurance"
    chosen = places | {"NUMBA_CACHE_DIR": str(project / "chosen")}
    assert run(project, ANSWER, **chosen) == "1 1 True"
    assert run(project, ANSWER, **chosen) == "1 0 False"


def test_whatever_the_umask_later_processes_run_what_was_kept(compiled):
    assert run(compiled.parent, ANSWER, NUMBA_CACHE_DIR=str(compiled)) == "1 0 False"


def test_kernels_that_are_not_to_be_compiled_are_reported(project):
    shutil.copy(ROOT / "raytrace" / "errors.py", project / "raytrace")
    script = "try:\n    from raytrace.loop import answer; answer()\nexcept ValueError as mistake:\n    print(mistake)"
    expected = "environment: NUMBA_DISABLE_JIT: expected 0 or nothing: kernels run as machine code alone, got 1"
    assert run(project, script, NUMBA_DISABLE_JIT="1", NUMBA_CACHE_DIR=str(project / "cache")) == expected
