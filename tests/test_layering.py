"""Imports run one way, and each foreign library has one door."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LAYERS = ("raytrace", "ao", "scenes", "cli")
DOORS = {
    "embreex": {"raytrace/embree.py"},
    "fast_simplification": {"scenes/generated/damage.py"},
    "OpenImageIO": {f"raytrace/{name}.py" for name in ("image", "image_input", "compare", "texture")},
}


def files():
    for layer in LAYERS[:-1]:
        yield from sorted((ROOT / layer).rglob("*.py"))
    yield ROOT / "cli.py"


def imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module


@pytest.mark.parametrize("path", list(files()), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_imports_run_from_the_command_line_down_to_the_ray_caster(path):
    name = path.relative_to(ROOT).as_posix()
    layer = name.split("/")[0].removesuffix(".py")
    above = LAYERS[LAYERS.index(layer) + 1 :]
    for module in imported(path):
        root = module.split(".")[0]
        assert root not in above, f"{name} imports {module}"
        assert root not in DOORS or name in DOORS[root], f"{name} imports {module}; its door is {DOORS[root]}"


def test_relative_imports_stay_within_their_package():
    for path in files():
        depth = len(path.relative_to(ROOT).parts) - 1
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                assert node.level <= max(depth, 0), path
