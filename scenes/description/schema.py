"""The keys of a TOML scene and the types of their values; docs/scenes.md explains each.

Only what was written is kept (`Table.given`): every default lives in the class that a table becomes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, StrictBool, ValidationError

from raytrace.errors import OptionError, SceneError, nearest_name
from raytrace.image.texture import wrap_modes
from raytrace.system.parameters import Radiance, expectation, first_fault

from ..field_errors import joined, shown


def _same_thrice(value: Any) -> Any:
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _name_or_table(value: Any) -> Any:
    if not isinstance(value, str | dict):
        raise ValueError("a name or a table")
    return value


def _length(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError('a length, such as 0.5, "25%" or inf')
    return value


def _wrap(value: Any) -> Any:
    try:
        return wrap_modes(value)
    except OptionError as error:
        raise ValueError(error.expected) from None


def _affine(rows: list[list[float]]) -> list[list[float]]:
    if [len(row) for row in rows] != [4] * 4 or rows[3] != [0, 0, 0, 1]:
        raise ValueError("four rows of four numbers, the last 0, 0, 0, 1")
    return rows


Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e100, le=1e100)]
Whole = Annotated[int, Field(strict=True)]
Vector = tuple[Number, Number, Number]
Length = Annotated[Any, BeforeValidator(_length)]


class Table(BaseModel):
    """Base of all tables: no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def given(self) -> dict[str, Any]:
        """The keys that were written, with their values."""
        return {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}


class Transform(Table):
    """scale, then rotate (or turn about axis), then translate; or a matrix."""

    translate: Vector | None = None
    rotate: Vector | None = None
    axis: Vector | None = None
    angle: Number | None = None
    scale: Annotated[Vector, BeforeValidator(_same_thrice)] | None = None
    matrix: Annotated[list[list[Number]], AfterValidator(_affine)] | None = None


class ObjectTable(Transform):
    """One entry of `[[objects]]`. Keys that are not declared here are the parameters of a built-in shape."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: str | None = None
    mesh: str | None = None
    builtin: str | None = None
    material: Annotated[Any, BeforeValidator(_name_or_table)] = None
    texture: str | None = None
    wrap: Annotated[Any, BeforeValidator(_wrap)] = None
    own_normals: StrictBool = True
    copies: Annotated[list[Transform], Field(min_length=1, fail_fast=True)] | None = None


class CameraTable(Table):
    """`[camera]`: position and target, or a direction from which everything is framed."""

    position: Vector | None = None
    target: Vector | None = None
    direction: Vector | None = None
    up: Vector | None = None
    field_of_view: Number | None = None
    height: Number | None = None
    aperture: Number | None = None
    focus: Number | None = None


class RenderTable(Table):
    """`[render]`: `raytrace.settings.Settings`, but for the obscurance."""

    width: Whole | None = None
    height: Whole | None = None
    samples: Whole | None = None
    shading: str | None = None
    normals: str | None = None
    shadows: StrictBool | None = None
    terminator: StrictBool | None = None
    crop: tuple[Whole, Whole, Whole, Whole] | None = None
    seed: Whole | None = None


class ObscuranceTable(Table):
    """`[obscurance]`: how w(p) enters, and where it comes from."""

    form: str | None = None
    baked: str | None = None
    falloff: str = "exponential"
    tau: Number | None = None
    half_distance: Length | None = None
    max_distance: Length | None = None
    samples: Whole | None = None
    seed: Whole | None = None


class Document(Table):
    """A whole scene file."""

    background: Radiance = (0.0, 0.0, 0.0)
    camera: CameraTable = CameraTable()
    render: RenderTable = RenderTable()
    obscurance: ObscuranceTable = ObscuranceTable()
    materials: Annotated[list[dict[str, Any]], Field(fail_fast=True)] = []
    objects: Annotated[list[ObjectTable], Field(min_length=1, fail_fast=True)]
    lights: Annotated[list[dict[str, Any]], Field(fail_fast=True)] = []


def parse_document(data: dict[str, Any], source: object) -> Document:
    """A checked document. Raises: SceneError: the first fault, with its path."""
    try:
        return Document.model_validate(data)
    except ValidationError as error:
        raise _scene_error(error, source) from None


def _scene_error(error: ValidationError, source: object) -> SceneError:
    fault = first_fault(error)
    location = fault["loc"]
    path = ""
    for part in location:
        path = joined(path, f"[{part}]" if isinstance(part, int) else part)
    if fault["type"] == "extra_forbidden":
        keys = _keys_beside(location)
        near = nearest_name(location[-1], keys)
        return SceneError(source, path, "one of " + ", ".join(keys), "an unknown key", near)
    if fault["type"] == "missing":
        return SceneError(source, path, _WORDS.get(str(location[-1]), "a value"), "nothing")
    if fault["type"] in ("too_short", "model_type", "model_attributes_type", "dict_type"):
        expected = "at least one" if fault["type"] == "too_short" else "a table"
        return SceneError(source, path, expected, "none" if fault["input"] == [] else shown(fault["input"]))
    return SceneError(source, path, expectation(fault), shown(fault["input"]))


_WORDS = {"objects": "at least one"}


def _keys_beside(location: tuple[int | str, ...]) -> list[str]:
    """The keys of the table that holds the last part of `location`."""
    table: type[BaseModel] = Document
    for part in location[:-1]:
        if isinstance(part, str):
            table = next(_tables(table.model_fields[part].annotation))
    return list(table.model_fields)


def _tables(annotation: Any) -> Iterator[type[Table]]:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in get_args(annotation):
        yield from _tables(inner)
