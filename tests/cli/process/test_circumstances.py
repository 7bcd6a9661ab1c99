"""One core, too many threads, no place for caches: the same bytes."""

import os
import subprocess
import sys

import pytest
from command import succeeded
from mesh_files import ply
from meshes import hills
from project import ROOT

SMALL_BLOCKS = (
    "from obscurance.ao.execute.tracer import Hemispheres; Hemispheres.block_rays //= 512; "  # enough for 64 threads
)
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux")


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    """Bakes hills by a command in given circumstances; returns the result's bytes and what was said."""
    folder = tmp_path_factory.mktemp("circumstances")
    mesh, target = folder / "hills.ply", folder / "w.npz"
    mesh.write_bytes(ply(*hills(60)))

    def run(*options, code=SMALL_BLOCKS + "from obscurance import cli; cli.main()", **settings):
        command = [sys.executable, "-c", code, "bake", mesh, "-o", target, "--samples", "64", *options]
        result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=600, **settings)
        assert result.returncode == 0, result.stderr
        content = target.read_bytes()
        target.unlink()
        return content, result.stderr

    return run


@pytest.fixture(scope="module")
def expected(bake):
    return bake()[0]


@LINUX
def test_one_core_gives_the_same_bytes(bake, expected):
    one = {min(os.sched_getaffinity(0))}
    assert bake(preexec_fn=lambda: os.sched_setaffinity(0, one)) == (expected, "")


@pytest.mark.parametrize("threads", ["1", "64", "4096"])
def test_any_number_of_threads_gives_the_same_bytes(bake, expected, threads):
    assert bake("--threads", threads) == (expected, "")


@LINUX
def test_many_threads_change_no_byte_where_address_space_is_short(bake, expected):
    """Address space for the bake and the stacks of a few threads."""
    code = (
        SMALL_BLOCKS
        + "import resource; from obscurance.raytrace.system.checks import _UNTOUCHED; from pathlib import Path;"
    )
    code += "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize();"
    code += "most = used + _UNTOUCHED[0] + (140 << 20);"
    code += "resource.setrlimit(resource.RLIMIT_AS, (most, most)); from obscurance import cli; cli.main()"
    assert bake("--threads", "64", code=code) == (expected, "")


@LINUX
@pytest.mark.slow
def test_folders_without_permission_are_no_obstacle(tmp_path):
    """Root may write everywhere, unless it gives up that power."""
    mesh, target, closed = tmp_path / "hills.ply", tmp_path / "w.npz", tmp_path / "closed"
    mesh.write_bytes(ply(*hills(60)))
    closed.mkdir(mode=0o555)
    given_up = "-dac_override,-dac_read_search"
    bind = ["setpriv", f"--bounding-set={given_up}", f"--inh-caps={given_up}"] if os.getuid() == 0 else []
    places = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "TMPDIR"), str(closed))
    code = f"import tempfile; tempfile.tempdir = {str(closed)!r}; from obscurance import cli; cli.main()"
    command = [*bind, sys.executable, "-c", code, "bake", mesh, "-o", target, "--samples", "64", "--quiet"]
    result = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=600, env=os.environ | places
    )
    assert result.returncode == 0, result.stderr
    assert not result.stderr
    content = target.read_bytes()
    assert not list(closed.iterdir())
    succeeded("bake", mesh, "-o", target, "--samples", 64)
    assert target.read_bytes() == content
