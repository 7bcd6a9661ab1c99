"""Values checked by the types of fields: plain ones come out, and what is wrong is named by its path."""

# ruff: noqa: RUF012 (defaults are never changed)
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from obscurance import raytrace
from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.system.records import At, Before, Fault, Record, Within, Words, fields_of, read

Fraction = Annotated[float, Within(0, 1)]
DEEP: list[Any] = []
for _ in range(100_000):
    DEEP = [DEEP]


def _even(value):
    if value % 2:
        raise ValueError("an even number")
    return value


class Leaf(Record):
    names: list[str] = []
    weights: dict[str, Fraction] = {}
    inner: Annotated[int | None, At("extensions.x.inner")] = None


class Tree(Record):
    size: int
    leaf: Leaf | None = None
    point: tuple[float, float, float] = (0, 0, 0)
    even: Annotated[int, _even] = 0
    doubled: Annotated[float, Before(lambda value: value * 2)] = 0.0
    angle: Annotated[float, Within(0, 90, "(]"), "degrees in (0, 90]"] = 45.0
    kind: Literal["oak", "birch", "pine"] = "oak"
    left_out: float | None = None


class Strict(Record):
    table = "a table"
    unknown = "refuse"
    colour: Annotated[str, Words("a colour")]


@dataclass
class Plain:
    number: float
    texts: tuple[str, ...] = ()


FAULTS = [
    (Tree, {}, "size", "a value", "nothing"),
    (Tree, [], "", "an object", []),
    (Tree, {"size": 1.0}, "size", "a whole number", 1.0),
    (Tree, {"size": True}, "size", "a whole number", True),
    (Tree, {"size": "1"}, "size", "a whole number", '"1"'),
    (Tree, {"size": None}, "size", "a whole number", None),
    (Tree, {"size": 1, "left_out": None}, "left_out", "a number", None),
    (Tree, {"size": 1, "leaf": {"extensions": 3}}, "leaf.extensions", "an object", 3),
    (
        Tree,
        {"size": 1, "leaf": {"extensions": {"x": {"inner": -0.5}}}},
        "leaf.extensions.x.inner",
        "a whole number",
        -0.5,
    ),
    (Tree, {"size": 1, "leaf": {"names": ["a", 1]}}, "leaf.names[1]", "a text", 1),
    (Tree, {"size": 1, "leaf": {"weights": {"a": 0, "\ud800": 2}}}, r"leaf.weights.'\ud800'", "a number in [0, 1]", 2),
    (Tree, {"size": 1, "leaf": {"weights": [1]}}, "leaf.weights", "an object", [1]),
    (Tree, {"size": 1, "point": [1, "2", 3]}, "point[1]", "a number", '"2"'),
    (Tree, {"size": 1, "point": [1, True, 3]}, "point[1]", "a number", True),
    (Tree, {"size": 1, "point": [1, 2]}, "point[2]", "a value", "nothing"),
    (Tree, {"size": 1, "point": [1, 2, 3, 4]}, "point", "at most 3", 4),
    (Tree, {"size": 1, "point": "123"}, "point", "a list of numbers", "123"),
    (Tree, {"size": 1, "point": DEEP}, "point[0]", "a number", DEEP[0]),
    (Tree, {"size": 1, "point": [0, 0, float("nan")]}, "point[2]", "a finite number", None),
    (Tree, {"size": 1, "point": [0, 0, 10**400]}, "point[2]", "a finite number", 10**400),
    (Tree, {"size": 1, "even": 3}, "even", "an even number", 3),
    (Tree, {"size": 1, "doubled": "a"}, "doubled", "a number", '"aa"'),
    (Tree, {"size": 1, "angle": 0}, "angle", "degrees in (0, 90]", 0),
    (Tree, {"size": 1, "angle": "0"}, "angle", "degrees in (0, 90]", "'0'"),
    (Tree, {"size": 1, "kind": "birk"}, "kind", "one of oak, birch, pine", "birk"),
    (Tree, {"size": 1, "kind": np.array(["oak"])}, "kind", "one of oak, birch, pine", None),
    (Strict, {}, "colour", "a colour", "nothing"),
    (Strict, {"colour": 1}, "colour", "a text", 1),
    (Strict, {"colur": "red"}, "colur", "one of colour", "an unknown key"),
    (Plain, {"texts": ["a"]}, "number", "a value", "nothing"),
    (list[Plain], [{"number": 1, "texts": ["a", 2]}], "[0].texts[1]", "a text", 2),
]


@pytest.mark.parametrize(("kind", "value", "place", "expected", "got"), FAULTS, ids=map(str, range(len(FAULTS))))
def test_what_is_wrong_is_named_by_its_path(kind, value, place, expected, got):
    with pytest.raises(Fault) as caught:
        read(kind, value)
    assert (caught.value.place, caught.value.expected) == (place, expected)
    assert got is None or caught.value.got == got


def test_what_a_file_has_is_kept_and_defaults_stand_on_the_class():
    tree = read(Tree, {"size": 3, "leaf": {"extensions": {"x": {"inner": 2}}}, "unknown": 1, "doubled": 2})
    assert (vars(tree).keys(), vars(tree.leaf)) == ({"size", "leaf", "doubled"}, {"inner": 2})
    assert (tree.size, tree.doubled, tree.kind, tree.leaf.names) == (3, 4.0, "oak", [])
    assert read(Tree, {"size": 3, "leaf": None}).leaf is None


def test_numbers_become_plain():
    tree = read(Tree, {"size": np.int32(3), "point": np.array([1, 2, 3], np.float32), "angle": np.array(30)})
    assert (tree.size, tree.point, tree.angle) == (3, (1.0, 2.0, 3.0), 30.0)
    assert [type(value) for value in (tree.size, tree.angle, *tree.point)] == [int, *[float] * 4]
    assert read(Plain, {"number": 1, "texts": ["a"]}) == Plain(1.0, ("a",))


def test_a_misspelt_name_has_the_one_that_was_meant():
    with pytest.raises(Fault) as caught:
        read(Strict, {"colur": "red"})
    assert caught.value.nearest == "colour"


def test_parameters_are_checked_however_they_are_made():
    light = raytrace.PointLight(position=(1, 2, 3))
    with pytest.raises(OptionError, match="position: expected a list of numbers, got 3"):
        replace(light, position=3)
    with pytest.raises(OptionError, match=r"positon: expected one of .* got an unknown key; did you mean position"):
        raytrace.PointLight(positon=(1, 2, 3))
    with pytest.raises(OptionError, match="PointLight: values: expected each by its name, as in PointLight"):
        raytrace.PointLight((1, 2, 3))
    assert fields_of(raytrace.PointLight).keys() >= {"position", "light"}
