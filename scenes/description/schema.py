"""The keys of a TOML scene and the types of their values; docs/scenes.md explains each.

Only what was written is kept (`Table.given`): every default lives in the class that a table becomes.
"""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, StrictBool, ValidationError

from raytrace.errors import OptionError, SceneError
from raytrace.image.texture import wrap_modes
from raytrace.system.faults import first_fault
from raytrace.system.parameters import Radiance, triple

from ..field_errors import shown


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


Whole = Annotated[int, Field(strict=True)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e100, le=1e100)]
Vector = tuple[Number, Number, Number]
Fraction = Annotated[Number, Field(ge=0, le=1)]
Length = Annotated[Any, BeforeValidator(_length)]


class Table(BaseModel):
    """Base of all tables: no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    def given(self) -> dict[str, Any]:
        """The keys that were written, with their values."""
        return {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}


class Transform(Table):
    """scale, then rotate (or turn about axis), then translate; or a matrix."""

    translate: Vector | None = None
    rotate: Vector | None = None
    axis: Vector | None = None
    angle: Number | None = None
    scale: Annotated[Vector, BeforeValidator(triple)] | None = None
    matrix: Annotated[list[list[Number]], AfterValidator(_affine)] | None = None


class ObjectTable(Transform):
    """One entry of `[[objects]]`. Keys that are not declared here are the parameters of a built-in shape."""

    model_config = ConfigDict(extra="allow")

    name: str | None = None
    mesh: str | None = None
    builtin: str | None = None
    material: Annotated[Any, BeforeValidator(_name_or_table)] = None
    texture: str | None = None
    grain: str | None = None
    opacity: Fraction | None = None
    opacity_texture: str | None = None
    cutoff: Fraction | None = None
    wrap: Annotated[Any, BeforeValidator(_wrap)] = None
    own_normals: StrictBool = True
    vertex_colors: StrictBool | None = None
    copies: Annotated[list[Transform], Field(min_length=1, fail_fast=True)] | None = None

    @property
    def images(self) -> list[str]:
        """The images that need texture coordinates."""
        return [name for name in (self.texture, self.grain, self.opacity_texture) if name is not None]


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


class ObscuranceTable(Table):
    """`[obscurance]`: how w(p) enters, and where it comes from."""

    form: str | None = None
    baked: str | None = None
    falloff: str = "exponential"
    tau: Number | None = None
    half_distance: Length | None = None
    power: Any = None
    max_distance: Length | None = None
    samples: Whole | None = None
    seed: Whole | None = None


class Document(Table):
    """A whole scene file."""

    background: Radiance = (0.0, 0.0, 0.0)
    camera: CameraTable = CameraTable()
    render: dict[str, Any] = {}
    obscurance: ObscuranceTable = ObscuranceTable()
    materials: Annotated[list[dict[str, Any]], Field(fail_fast=True)] = []
    objects: Annotated[list[ObjectTable], Field(min_length=1, fail_fast=True, description="at least one")]
    lights: Annotated[list[dict[str, Any]], Field(fail_fast=True)] = []


def parse_document(data: dict[str, Any], source: object) -> Document:
    """A checked document. Raises: SceneError: the first fault, with its path."""
    try:
        return Document.model_validate(data)
    except ValidationError as error:
        path, expected, got, near = first_fault(error, Document, shown)
        raise SceneError(source, path, expected, got, near) from None
