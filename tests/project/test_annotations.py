"""All functions are annotated but kernels and what writes LLVM code; pyproject.toml excuses no module without such."""

import ast
import tomllib
from fnmatch import fnmatch

from project import ROOT

FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path
    for package in ("raytrace", "ao", "scenes")
    for path in sorted((ROOT / package).rglob("*.py"))
} | {"cli": ROOT / "cli.py"}
KERNELS = {"kernel", "inline", "intrinsic"}
WRITES_LLVM = "raytrace.kernel.simd"


def without_annotations(module):
    """The functions of a module that have a parameter or a result without annotation."""
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            arguments += [argument for argument in (node.args.vararg, node.args.kwarg) if argument]
            untyped = [argument.arg for argument in arguments if not argument.annotation]
            if not set(untyped) <= {"self", "cls"} or not node.returns:
                yield node


def is_kernel(function):
    names = (node.func if isinstance(node, ast.Call) else node for node in function.decorator_list)
    return any(isinstance(name, ast.Name) and name.id in KERNELS for name in names)


def test_functions_without_annotations_are_kernels():
    other = [
        f"{module}.{function.name}"
        for module in FILES
        if module != WRITES_LLVM
        for function in without_annotations(module)
        if not is_kernel(function)
    ]
    assert not other


def test_only_modules_with_kernels_are_excused():
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]["overrides"]
    (patterns,) = (table["module"] for table in tables if table.get("disallow_untyped_defs") is False)
    excused = {pattern: [module for module in FILES if fnmatch(module, pattern)] for pattern in patterns}
    idle = [pattern for pattern, modules in excused.items() if not any(map(list, map(without_annotations, modules)))]
    assert not idle
