"""Imports run one way, between packages, between their folders and within a folder; foreign libraries have one door."""

import ast
import graphlib
import re
from collections import defaultdict
from functools import cache

from project import ROOT

ORDER = [
    *("raytrace.types", "raytrace.errors", "raytrace.kernel", "raytrace.system", "raytrace.settings"),
    *("raytrace.text", "raytrace.sampling", "raytrace.embree", "raytrace.bvh", "raytrace.image", "raytrace.mesh"),
    *("raytrace.ray_origins", "raytrace.lights", "raytrace.brdf", "raytrace.camera"),
    "raytrace.scene",
    *("raytrace.shade", "raytrace.renderer"),
    *("ao.mu", "ao.falloff", "ao.profile", "ao.declared", "ao.options", "ao.memory"),
    *("ao.points", "ao.rays", "ao.execute", "ao.estimate", "ao.prepared", "ao.least_squares"),
    *("ao.result", "ao.methods", "ao.texture"),
    *("ao.interpolation_error", "ao.baking", "ao.refine", "ao.unseen", "ao.report", "ao.cluster", "ao.closed_forms"),
    *("scenes.json_toml", "scenes.safe_paths", "scenes.geometry", "scenes.asset", "scenes.formats"),
    *("scenes.falloffs", "scenes.description"),
    *("scenes.show", "scenes.library", "scenes.validation", "scenes.bake", "scenes.check", "scenes.commands"),
    "cli",
]
"""Every folder and every file outside folders: each may import what stands before it."""

DOORS = {
    "dask": {"ao.cluster.workers"},
    "distributed": {"ao.cluster.workers"},
    "embreex": {"raytrace.embree"},
    "llvmlite": {f"raytrace.kernel.{name}" for name in ("lanes", "compiler")},
    "numba": {f"raytrace.kernel.{name}" for name in ("lanes", "compiler", "build")},
    "uvunwrap": {"scenes.bake.uv"},
    "OpenImageIO": {"raytrace.image.formats"},
}
TREES = ("ao", "raytrace", "scenes", "obscurance", "tests", "benchmarks", "docs")
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for top in ("raytrace", "ao", "scenes")
    for path in sorted((ROOT / top).rglob("*.py"))
    if path.parent != ROOT / top or path.name != "__init__.py"
} | {"cli": ROOT / "cli.py"}
PUBLIC = {
    f"{top}.{alias.name}": f"{top}.{node.module}"
    for top in ("raytrace", "ao", "scenes")
    for node in ast.walk(ast.parse((ROOT / top / "__init__.pyi").read_text()))
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
"""The public names, and the modules that they come from."""


def within(name):
    """A name as it is within the package."""
    return name.removeprefix("obscurance.")


def room(module):
    return ".".join(module.split(".")[:2])


@cache
def imported(module):
    """Modules of the project and foreign names that a module imports, wherever in its text."""
    names = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.Import):
            names |= {within(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            up = node.level - (MODULES[module].name == "__init__.py")
            parent = ".".join(module.split(".")[: -up or None]) if node.level else ""
            source = within(".".join(part for part in (parent, node.module) if part))
            for alias in node.names:
                name = within(f"{source}.{alias.name}")
                names.add(PUBLIC.get(name, name if name in MODULES else source))
    return names


def test_every_folder_has_its_place_in_the_order():
    assert {room(module) for module in MODULES} == set(ORDER)


def test_imports_run_down_the_order_of_the_folders():
    for module in MODULES:
        for name in imported(module) & MODULES.keys():
            assert ORDER.index(room(name)) <= ORDER.index(room(module)), f"{module} imports {name}"


def test_each_foreign_library_has_its_doors():
    for module in MODULES:
        for name in imported(module):
            doors = DOORS.get(name.split(".")[0], {module})
            assert module in doors, f"{module} imports {name}; its doors are {doors}"


def test_no_circle_of_imports():
    graph = defaultdict(set)
    for module in MODULES:
        graph[module] = imported(module) & MODULES.keys()
    graphlib.TopologicalSorter(graph).prepare()


def test_nothing_is_imported_by_a_name_that_only_the_source_tree_has():
    line = re.compile(r"^\s*(?:from|import)\s+(?:.*,\s*)?(?:ao|raytrace|scenes|cli)\b", re.MULTILINE)
    for path in (ROOT / "cli.py", *(path for top in TREES for path in (ROOT / top).rglob("*.py"))):
        text = path.read_text()
        for node in ast.walk(ast.parse(text)) if line.search(text) else ():
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            else:
                continue
            assert not {name.split(".")[0] for name in names} & {"ao", "raytrace", "scenes", "cli"}, path


ONE_EACH = ("raytrace.brdf.models", "scenes.formats", "scenes.commands")
"""Folders where a file is a model, a format or a command: as short as that is, and as many as there are."""
SHORT = {
    *("raytrace.settings", "raytrace.kernel.arrays", "scenes.description.read"),
    "ao.rays.ray_scene",
}
"""Others below 60 lines, found by their names, that belong into no larger file."""


def test_files_have_60_to_500_lines():
    for module, path in MODULES.items():
        lines = len(path.read_text(encoding="utf-8").splitlines())
        may_be_short = path.name == "__init__.py" or module in SHORT or module.startswith(ONE_EACH)
        assert lines <= 500, f"{module}: {lines} lines"
        assert lines >= 60 or may_be_short, f"{module}: {lines} lines; fold it into the room that uses it"


def test_folders_hold_about_a_dozen_files():
    files = defaultdict(int)
    for module, path in MODULES.items():
        files[path.parent] += path.name != "__init__.py" and module.rpartition(".")[0] not in ONE_EACH
    assert max(files.values()) <= 14, max(files, key=files.get)


def test_folders_of_tests_do_so_too():
    files = defaultdict(int)
    for path in (ROOT / "tests").rglob("*.py"):
        files[path.parent] += 1
    assert max(files.values()) <= 14, max(files, key=files.get)
