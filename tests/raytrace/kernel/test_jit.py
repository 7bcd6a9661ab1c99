"""The kernel cache: stale kernels never run, read-only places are no obstacle."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from project import ROOT

HELPER = """
from .kernel.jit import inline

@inline
def constant():
    return {value}
"""
KERNEL = """
from .helper import constant
from .kernel.jit import kernel

@kernel
def answer():
    return constant()
"""


def run(folder, code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout.strip()


@pytest.fixture
def project(tmp_path):
    package = tmp_path / "raytrace"
    package.mkdir()
    (tmp_path / "ao").mkdir()
    (package / "__init__.py").touch()
    shutil.copytree(ROOT / "raytrace" / "kernel", package / "kernel", ignore=shutil.ignore_patterns("vector.py"))
    shutil.copy(ROOT / "raytrace" / "types.py", package)
    (package / "helper.py").write_text(HELPER.format(value=1))
    (package / "loop.py").write_text(KERNEL)
    return tmp_path


ANSWER = """
import sys
from raytrace.kernel.jit import compiled
from raytrace.loop import answer
print(answer(), len(compiled), "numba" in sys.modules)
"""


def test_an_edit_in_another_file_reaches_the_kernel(project):
    cache = str(project / "cache")
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 0 False"
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=2))
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "2 1 True"


def test_a_cache_that_cannot_be_written_is_passed_over(project):
    blocked = project / "file"
    blocked.touch()
    nowhere = {"NUMBA_CACHE_DIR": str(blocked / "x"), "XDG_CACHE_HOME": str(blocked), "TMPDIR": str(project)}
    code = "from raytrace.kernel.cache import user_cache; print(user_cache())"
    assert run(project, code, **nowhere | {"XDG_CACHE_HOME": str(project)}) == str(project / "obscurance")
    assert Path(run(project, code, **nowhere)).parent == project
    assert run(project, ANSWER, **nowhere) == "1 1 True"


WHERE = "from raytrace.kernel.cache import user_cache; print(user_cache())"


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
    code = "from raytrace.kernel.cache import user_cache; print(user_cache())"
    assert run(project, stranger + code, TMPDIR=str(project)) == str(project / "obscurance-12345")


def test_a_full_disk_is_passed_over(project):
    full = "import shutil; before = shutil.disk_usage; "
    full += "shutil.disk_usage = lambda f: before(f)._replace(free=5 if f.name == 'full' else 1 << 30); "
    places = {"NUMBA_CACHE_DIR": str(project / "full"), "XDG_CACHE_HOME": str(project)}
    code = "from raytrace.kernel.cache import user_cache; print(user_cache())"
    assert run(project, full + code, **places) == str(project / "obscurance")


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (50, 50)); "


@pytest.mark.skipif(os.name != "posix", reason="limits")
def test_a_disk_that_fills_while_kernels_are_written_is_no_obstacle(project):
    cache = project / "cache"
    assert run(project, FULL + ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 1 True"
    assert not [path for path in cache.rglob("*") if path.is_file() and path.stat().st_size]
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 0 False"


@pytest.mark.parametrize("length", [0, 30, 500])
def test_half_a_file_in_the_cache_is_passed_over(project, length):
    cache = project / "cache"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 1 True"
    (path,) = (path for path in cache.rglob("*") if path.is_file())
    assert path.stat().st_size > length
    os.truncate(path, length)
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=str(cache)) == "1 0 False"


def test_another_setting_of_numba_or_another_processor_has_kernels_of_its_own(project):
    cache = str(project / "cache")
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache, NUMBA_OPT="1") == "1 1 True"
    elsewhere = "import llvmlite.binding; llvmlite.binding.get_host_cpu_name = lambda: 'another'\n" + ANSWER
    assert run(project, elsewhere, NUMBA_CACHE_DIR=cache) == "1 1 True"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 0 False"
