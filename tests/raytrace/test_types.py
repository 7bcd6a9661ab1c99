"""Types that kernels are built for, as their annotations name them."""

import re
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from project import ROOT

from obscurance.raytrace.kernel import build
from obscurance.raytrace.kernel.jit import Kernel
from obscurance.raytrace.types import Bools, Float32Grid, Float64Rows, Float64s, Int32s, UInt8s, examples


class Inner(NamedTuple):
    values: Float64Rows
    count: int
    more: "Int32s | None"


class Outer(NamedTuple):
    inner: Inner
    pair: tuple[UInt8s, float]
    key: np.uint32


CASES = {
    "number": (float, ["<f8"]),
    "NumPy's number": (np.uint32, ["<u4"]),
    "truth": (bool, ["|b1"]),
    "array": (Float64s, ["<f8:1C"]),
    "array of an element": (npt.NDArray[np.uint16], ["<u2:1C"]),
    "rows": (Float64Rows, ["<f8:2C"]),
    "grid": (Float32Grid, ["<f4:3C"]),
    "axes of one's own": (Annotated[Bools, 4], ["|b1:4C"]),
    "alternatives": (Int32s | Float64s | None, ["<i4:1C", "<f8:1C", "None"]),
    "tuple": (tuple[int, Float64s | Float64Rows], ["( <i8 <f8:1C )", "( <i8 <f8:2C )"]),
    "record": (Inner, ["Inner( <f8:2C <i8 <i4:1C )", "Inner( <f8:2C <i8 None )"]),
    "record of records": (
        Outer,
        [
            f"Outer( {inner} ( |u1:1C <f8 ) <u4 )"
            for inner in ("Inner( <f8:2C <i8 <i4:1C )", "Inner( <f8:2C <i8 None )")
        ],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_an_annotation_names_types(name):
    hint, lines = CASES[name]

    def function(a: hint) -> None: ...

    kernel = Kernel(function)
    said = [kernel.signature((value,)).line.partition(" ")[2] for value in examples(function)["a"]]
    assert [re.sub(r"\S+\.(?=\w+\()", "", line) for line in said] == lines


def test_what_no_kernel_takes_is_no_type():
    def function(a: Any) -> None: ...

    with pytest.raises(TypeError):
        examples(function)


def test_every_kernel_of_the_project_says_its_types():
    """Where one does not, the library would be without it."""
    decorated = re.compile(r"^@(?:kernel|called_back|parallel|each)\b.*(?:\n.*?)*?^def (\w+)\(", re.MULTILINE)
    built = {entry.signature.line.split()[0].split("@")[0] for name in build.modules() for entry in build.entries(name)}
    for package in ("raytrace", "ao"):
        for path in (ROOT / package).rglob("*.py"):
            module = ".".join(("obscurance", *path.relative_to(ROOT).with_suffix("").parts))
            for function in decorated.findall(path.read_text(encoding="utf-8")):
                assert f"{module}.{function}" in built
