"""The kernel cache: stale kernels never run, read-only places are no obstacle."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HELPER = """
from .jit import inline

@inline
def constant():
    return {value}
"""
KERNEL = """
from .helper import constant
from .jit import kernel

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
    shutil.copy(ROOT / "raytrace" / "jit.py", package)
    (package / "__init__.py").touch()
    (package / "helper.py").write_text(HELPER.format(value=1))
    (package / "loop.py").write_text(KERNEL)
    return tmp_path


ANSWER = "from raytrace.loop import answer; print(answer(), sum(answer.stats.cache_hits.values()))"


def test_an_edit_in_another_file_reaches_the_kernel(project):
    cache = str(project / "cache")
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 0"
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "1 1"
    (project / "raytrace" / "helper.py").write_text(HELPER.format(value=2))
    assert run(project, ANSWER, NUMBA_CACHE_DIR=cache) == "2 0"


def test_a_cache_that_cannot_be_written_is_passed_over(project):
    blocked = project / "file"
    blocked.touch()
    nowhere = {"NUMBA_CACHE_DIR": str(blocked / "x"), "XDG_CACHE_HOME": str(blocked), "TMPDIR": str(project)}
    code = "from raytrace.jit import user_cache; print(user_cache())"
    assert run(project, code, **nowhere | {"XDG_CACHE_HOME": str(project)}) == str(project / "obscurance")
    assert Path(run(project, code, **nowhere)).parent == project
    assert run(project, ANSWER, **nowhere) == "1 0"


def test_a_folder_is_warm_once_a_kernel_is_in_it(project):
    code = "from raytrace.jit import is_warm; print(is_warm('loop'), is_warm('helper'))"
    cache = str(project / "cache")
    assert run(project, code, NUMBA_CACHE_DIR=cache) == "False False"
    run(project, ANSWER, NUMBA_CACHE_DIR=cache)
    assert run(project, code, NUMBA_CACHE_DIR=cache) == "True False"


def test_numbas_own_setting_is_left_alone():
    code = (
        "import numba; before = numba.config.CACHE_DIR; import raytrace.query; print(numba.config.CACHE_DIR == before)"
    )
    assert run(ROOT, code) == "True"
