"""The names of the packages: all there, shown, imported when first used; what belongs to a package is installed."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from types import ModuleType

import pytest
from project import ROOT

from obscurance.raytrace.kernel.library import file_of
from obscurance.raytrace.kernel.processor import levels

PACKAGES = ("raytrace", "ao", "scenes")


def stub_names(package):
    tree = ast.parse((ROOT / package / "__init__.pyi").read_text())
    return sorted(alias.asname for node in tree.body for alias in node.names)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_shown_and_is_there(package):
    module = import_module(f"obscurance.{package}")
    assert dir(module) == sorted(module.__all__) == stub_names(package)
    assert not any(isinstance(getattr(module, name), ModuleType) for name in dir(module))
    assert not hasattr(module, "no_such_name")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_documented_once(package):
    page = (ROOT / "docs" / "api" / f"{package}.md").read_text()
    assert sorted(re.findall(rf"^\.\. [a-z:]+:: obscurance\.{package}\.(\w+)$", page, re.MULTILINE)) == stub_names(
        package
    )


def fresh(code):
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, timeout=120
    )
    return run.stdout.strip()


def test_importing_the_packages_imports_nothing_heavy():
    code = f"import sys; from obscurance import {', '.join(PACKAGES)}; "
    code += "print([m for m in ('numpy', 'numba') if m in sys.modules])"
    assert fresh(code) == "[]"


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_or_folder_has_a_public_name(package):
    assert not set(stub_names(package)) & {path.stem for path in (ROOT / package).iterdir()}


def test_every_folder_of_modules_is_a_package():
    for package in PACKAGES:
        for folder in {path.parent for path in (ROOT / package).rglob("*.py")}:
            assert (folder / "__init__.py").exists(), folder


def _listed(name, patterns):
    folder = ROOT.joinpath(*name.split(".")[1:])
    return {path for pattern in patterns[name] for path in folder.glob(pattern)}


def test_every_file_that_is_no_module_is_installed():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    for package in PACKAGES:
        folder = ROOT / package
        wanted = {path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
        wanted -= {file_of(level) for level in levels()}  # built, and installed as extension modules are
        typed = {path for name in ("*.pyi", "py.typed") for path in folder.rglob(name)}
        stubs = {path for path in typed if (path.parent / "__init__.py").exists()}
        listed = {path for name in patterns if name.split(".")[1:2] == [package] for path in _listed(name, patterns)}
        assert wanted == {path for path in wanted if path.suffix == ".py"} | stubs | listed
    assert patterns["*"] == ["*.pyi", "py.typed"]
