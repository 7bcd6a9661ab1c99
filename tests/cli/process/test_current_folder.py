"""Python files in the current folder, beside the meshes, are never run."""

import shutil
import subprocess
import sys

import pytest
from clusters import LEFT_SOCKETS
from command import COMMAND
from mesh_files import obj
from meshes import hills
from project import ROOT, environment

MODULES = "multiprocessing", "selectors", "signal", "struct", "scenes", "raytrace", "numpy"
AS_MODULE = [sys.executable, "-m", "obscurance"]
pytestmark = LEFT_SOCKETS


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(40)))
    for name in MODULES:
        (tmp_path / f"{name}.py").write_text(f"open('run-{name}', 'w').close()\nraise SystemExit('{name}')\n")
    return tmp_path


def run(command, folder, *arguments):
    line = [*command, *arguments]
    result = subprocess.run(line, cwd=folder, env=environment(), capture_output=True, text=True, check=False)
    assert (list(folder.glob("run-*")), result.returncode) == ([], 0), result.stderr
    return result.stdout


def test_workers_import_nothing_from_it(folder):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    said = run(AS_MODULE, folder, "bake", "hills.obj", "-o", "w.npz", "--samples", "400", "--cluster", "local")
    assert said.endswith("local: 1 block made by workers\n")


def test_the_package_run_as_a_module_imports_nothing_from_it(folder):
    assert "hills.obj\n" in run(AS_MODULE, folder, "info", "hills.obj")


@pytest.mark.parametrize("command", [COMMAND, [sys.executable, "-P", "-m", "obscurance"]])
def test_nor_is_a_file_of_the_command_s_name_run(folder, command):
    (folder / "obscurance.py").write_text("open('run-obscurance', 'w').close()\n")
    assert "hills.obj\n" in run(command, folder, "info", "hills.obj")


def test_a_source_tree_run_as_a_module_imports_itself(tmp_path):
    shutil.copytree(ROOT / "obscurance", tmp_path / "obscurance")
    (tmp_path / "cli.py").write_text("from beside import main\n")
    (tmp_path / "beside.py").write_text("def main():\n    print('this one')\n")
    assert run(AS_MODULE, tmp_path) == "this one\n"
