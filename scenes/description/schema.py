"""The keys of a TOML scene and the types of their values; docs/scenes.md explains each.

Every default lives in the class that a table becomes, from the keys that were written (`vars`).
"""

# ruff: noqa: RUF012 (empty lists as defaults are shared, and never changed)
from typing import Annotated, Any

import numpy as np

from obscurance.raytrace.errors import OptionError, SceneError
from obscurance.raytrace.image.texture import wrap_modes
from obscurance.raytrace.system.parameters import Radiance, triple
from obscurance.raytrace.system.records import Before, Fault, Record, Within, Words, fields_of, read
from obscurance.raytrace.types import Float64s

from ..geometry.instances import rotation_about, rotation_about_axes
from ..json_toml import joined, shown


def _name_or_table(value: Any) -> Any:
    """Check that a value is a text or a table."""
    if not isinstance(value, str | dict):
        raise ValueError("a name or a table")
    return value


def _length(value: Any) -> Any:
    """Check that a value is a number or a text, as lengths are."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError('a length, such as 0.5, "25%" or inf')
    return value


def _wrap(value: Any) -> Any:
    """Wrap modes along u and v. Raises: ValueError."""
    try:
        return wrap_modes(value)
    except OptionError as error:
        raise ValueError(error.expected) from None


def _some(values: list[Any]) -> list[Any]:
    """Check that there is at least one value. Raises: Fault."""
    if not values:
        raise Fault("at least one", Words("none"))
    return values


def _affine(matrix_rows: list[list[float]]) -> list[list[float]]:
    """Check that rows are those of an affine matrix."""
    if [len(row) for row in matrix_rows] != [4] * 4 or matrix_rows[3] != [0, 0, 0, 1]:
        raise ValueError("four rows of four numbers, the last 0, 0, 0, 1")
    return matrix_rows


Number = Annotated[float, Within(-1e100, 1e100, words="a finite number")]
Vector = tuple[Number, Number, Number]
Fraction = Annotated[float, Within(0, 1)]
Length = Annotated[Any, _length]


class Table(Record):
    """Base of all tables: no unknown keys."""

    table = "a table"
    unknown = "refuse"


class Transform(Table):
    """scale, then rotate (or turn about axis), then translate; or a matrix."""

    translate: Vector | None = None
    rotate: Vector | None = None
    axis: Vector | None = None
    angle: Number | None = None
    scale: Annotated[Vector, Before(triple)] | None = None
    matrix: Annotated[list[list[Number]], _affine] | None = None

    def affine(self, source: object, path: str) -> Float64s:
        """The affine (4, 4) map for column vectors. Raises: SceneError: none, or keys that exclude each other."""

        def fault(key: str, expected: str, got: object) -> SceneError:
            return SceneError(source, joined(path, key), expected, got)

        # A matrix stands alone.
        if self.matrix is not None:
            others = [key for key in fields_of(Transform) if key != "matrix" and key in vars(self)]
            if others:
                raise fault("matrix", "nothing beside it", ", ".join(others))
            matrix = np.array(self.matrix)
            if not np.linalg.det(matrix[:3, :3]):
                raise fault("matrix", "an invertible matrix", shown(self.matrix))
            return matrix
        # Keys that exclude or need each other.
        if (self.axis is None) != (self.angle is None):
            raise fault("axis" if self.axis is None else "angle", "axis and angle together", "one alone")
        if self.axis is not None and self.rotate is not None:
            raise fault("rotate", "either rotate, or axis and angle", "both")
        # The rotation, then the scale before it, then the translation.
        matrix = np.eye(4)
        if self.axis is not None and self.angle is not None:
            if not np.linalg.norm(self.axis) > 0:
                raise fault("axis", "a vector other than zero", list(self.axis))
            matrix[:3, :3] = rotation_about(self.axis, self.angle)
        if self.rotate is not None:
            matrix[:3, :3] = rotation_about_axes(self.rotate)
        if self.scale is not None:
            matrix[:3, :3] *= self.scale
            if not np.linalg.det(matrix[:3, :3]):
                raise fault("scale", "numbers other than 0, whose product is not 0 either", list(self.scale))
        if self.translate is not None:
            matrix[:3, 3] = self.translate
        return matrix


class ObjectTable(Transform):
    """One entry of `[[objects]]`. Keys that are not declared here are the parameters of a built-in shape."""

    unknown = "keep"

    name: str | None = None
    mesh: str | None = None
    builtin: str | None = None
    material: Annotated[Any, _name_or_table] = None
    texture: str | None = None
    grain: str | None = None
    opacity: Fraction | None = None
    opacity_texture: str | None = None
    cutoff: Fraction | None = None
    wrap: Annotated[Any, _wrap] = None
    own_normals: bool = True
    vertex_colors: bool | None = None
    copies: Annotated[list[Transform], _some] | None = None

    @property
    def textured(self) -> bool:
        """Whether the material has images, which need texture coordinates."""
        return (self.texture, self.grain, self.opacity_texture) != (None, None, None)


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
    samples: int | None = None
    seed: int | None = None


class Document(Table):
    """A whole scene file."""

    background: Radiance = (0.0, 0.0, 0.0)
    camera: CameraTable = CameraTable()
    render: dict[str, Any] = {}
    obscurance: ObscuranceTable = ObscuranceTable()
    materials: list[dict[str, Any]] = []
    objects: Annotated[list[ObjectTable], _some, Words("at least one")]
    lights: list[dict[str, Any]] = []


def parse_document(data: dict[str, Any], source: object) -> Document:
    """A checked document. Raises: SceneError: the first fault, with its path."""
    try:
        return read(Document, data)
    except Fault as fault:
        raise SceneError(source, fault.place, fault.expected, shown(fault.got), fault.nearest) from None
