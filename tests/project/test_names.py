"""Names in docstrings and pages are names of the program; functions take eight parameters at most and are annotated."""

import ast
import re
import tomllib
from collections import defaultdict
from fnmatch import fnmatch
from functools import cache

from project import ROOT

PACKAGES = ("raytrace", "ao", "scenes")
FOLDERS = ("docs", "benchmarks")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(p for f in FOLDERS for p in (ROOT / f).rglob("*.md"))]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
} | {"cli": ROOT / "cli.py"}
LIBRARIES = ("OpenImageIO", "numba", "pyvista", "scipy")
QUOTED = re.compile(r"(?<!`)`([^`]+)`(?!`)")
NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")
FILE = re.compile(rf"(?:(?:{'|'.join(PACKAGES)}|tests|benchmarks|docs)/[\w./]*|\w+\.pyi?)")
MOST_PARAMETERS = 8
HELPERS = {"inline", "intrinsic"}
WRITES_LLVM = "raytrace.kernel.simd"


@cache
def nodes(path):
    """All nodes of a file's tree."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def docstrings(module):
    """Texts that stand as statements: docstrings, and what follows a constant."""
    for node in nodes(FILES[module]):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value


def bound(nodes):
    """Names that nodes bind, attributes of `self` among them."""
    for child in nodes:
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            yield child.name
        elif isinstance(child, ast.alias):
            yield (child.asname or child.name).split(".")[0]
        elif isinstance(child, ast.Name) and isinstance(child.ctx, ast.Store):
            yield child.id
        elif isinstance(child, ast.Attribute) and isinstance(child.ctx, ast.Store):
            yield child.attr


@cache
def names_of(module):
    stub = FILES[module].with_suffix(".pyi")
    return {*bound(nodes(FILES[module])), *(bound(nodes(stub)) if stub.exists() else ())}


@cache
def members():
    """Of each class its own members and those of the classes below which it stands."""
    classes = {node.name: node for path in FILES.values() for node in nodes(path) if isinstance(node, ast.ClassDef)}
    found = defaultdict(set)
    for name, node in classes.items():
        queue = [node]
        while queue:
            each = queue.pop()
            found[name] |= set(bound(ast.walk(each)))
            queue += [classes[base.id] for base in each.bases if isinstance(base, ast.Name) and base.id in classes]
    return found


@cache
def vocabulary():
    """Every word of the program's code, docstrings left out."""
    texts = set()
    for module, path in FILES.items():
        prose = set(map(id, docstrings(module)))
        for node in nodes(path):
            if id(node) not in prose:
                texts.update(text for text in vars(node).values() if isinstance(text, str))
    return {*FILES, *re.findall(r"\w+", "\n".join((*texts, *FILES)))}


def is_missing(name):
    """Whether a dotted name begins as one of the program's does and is none."""
    parts = name.removeprefix("obscurance.").split(".")
    module = next((".".join(parts[:k]) for k in range(len(parts), 0, -1) if ".".join(parts[:k]) in FILES), None)
    rest = parts[len(module.split(".")) :] if module else parts
    if module and rest and rest[0] not in names_of(module):
        return True
    if len(rest) < 2 or not (module or rest[0] in members()):
        return False
    return rest[1] not in members().get(rest[0], ())


def quoted_names(text):
    """Names between backticks, of calls without what is in the brackets, of files left out."""
    names = [re.sub(r"\(.*\)$", "", quoted, flags=re.DOTALL) for quoted in QUOTED.findall(text)]
    return [name for name in names if NAME.fullmatch(name) and not FILE.fullmatch(name)]


@cache
def file_names():
    return {path.name for top in (*PACKAGES, "tests", "benchmarks") for path in (ROOT / top).rglob("*.py*")}


def missing_files(text):
    """Paths and names of files that are not there; one without a folder may be anywhere."""
    quoted = [name for name in QUOTED.findall(text) if FILE.fullmatch(name)]
    return [name for name in quoted if not (ROOT / name).exists() and ("/" in name or name not in file_names())]


def test_names_in_docstrings_are_of_the_program():
    for module in FILES:
        for text in docstrings(module):
            assert missing_files(text.value) == [], module
            for name in quoted_names(text.value):
                if not name.startswith(LIBRARIES):
                    assert set(name.split(".")) <= vocabulary(), f"{module}: {name}"
                    assert not is_missing(name), f"{module}: {name}"


def test_names_in_pages_are_of_the_program():
    for page in PAGES:
        assert [name for name in quoted_names(page.read_text(encoding="utf-8")) if is_missing(name)] == [], page


def test_files_that_pages_name_are_there():
    for page in [*PAGES, ROOT / "CHANGELOG.md"]:
        assert missing_files(page.read_text(encoding="utf-8")) == [], page


WRITTEN_OUT = {"bake", "bake_points", "bake_texture"}
"""Functions that take all options, each as a parameter, so that an editor shows them."""


def test_functions_take_eight_parameters_at_most():
    """But commands, and bakes."""
    for module in FILES.keys() - {"cli"}:
        for node in nodes(FILES[module]):
            if isinstance(node, ast.FunctionDef):
                given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                names = [argument.arg for argument in given if argument.arg not in ("self", "cls")]
                allowed = len(names) <= MOST_PARAMETERS or node.name in WRITTEN_OUT
                assert allowed, f"{module}.{node.name}({', '.join(names)})"


def without_annotations(module):
    """The functions of a module that have a parameter or a result without annotation."""
    for node in nodes(FILES[module]):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            arguments += [argument for argument in (node.args.vararg, node.args.kwarg) if argument]
            untyped = [argument.arg for argument in arguments if not argument.annotation]
            if not set(untyped) <= {"self", "cls"} or not node.returns:
                yield node


def is_helper(function):
    names = (node.func if isinstance(node, ast.Call) else node for node in function.decorator_list)
    return any(isinstance(name, ast.Name) and name.id in HELPERS for name in names)


def test_functions_without_annotations_are_helpers_of_kernels():
    other = [
        f"{module}.{function.name}"
        for module in FILES
        if module != WRITES_LLVM
        for function in without_annotations(module)
        if not is_helper(function)
    ]
    assert not other


def test_only_modules_with_such_helpers_are_excused():
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]["overrides"]
    (patterns,) = (table["module"] for table in tables if table.get("disallow_untyped_defs") is False)
    excused = {
        pattern: [module for module in FILES if fnmatch(f"obscurance.{module}", pattern)] for pattern in patterns
    }
    idle = [pattern for pattern, modules in excused.items() if not any(map(list, map(without_annotations, modules)))]
    assert not idle
