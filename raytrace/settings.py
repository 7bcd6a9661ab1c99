"""How a picture is made: size, samples, interpolation, what is switched on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from .errors import OptionError, check_type, nearest_name

Shading = Literal["constant", "flat", "gouraud", "phong", "quadratic"]
Normals = Literal["file", "angle", "area", "equal"]
ObscuranceForm = Literal["off", "ambient", "book"]
MAX_SIZE, MAX_SAMPLES = 32768, 4096


@dataclass(frozen=True)
class Settings:
    """Settings of a rendering.

    Attributes:
        width, height: pixels.
        samples: most rays a pixel; pixels whose first samples agree get no more.
        shading: interpolation over a face: constant (the textbook's, without specular terms), flat (constant with
            them), Gouraud, Phong, or quadratic (van Overveld & Wyvill).
        obscurance: what w(p) weights: "ambient" light alone; "book", the textbook's (12.75): ambient and diffuse
            light; "off": nothing.
        shadows: trace shadow rays for the visibility δ(p, j).
        terminator: move shadow rays' origins off a coarse mesh onto the smooth surface that its normals describe.
        crop: (x, y, width, height) in pixels from the upper left; only these are rendered.
        seed: of the pixel samples.
        normals: of vertices: "file", a mesh's own where it has some and else "angle"; or means over the faces around a
            vertex, weighted by "angle" (12.33), "area" (12.32) or "equal" (12.31), whatever the mesh has.

    Raises:
        OptionError: a value out of range.
    """

    width: int = 960
    height: int = 640
    samples: int = 16
    shading: Shading = "phong"
    obscurance: ObscuranceForm = "ambient"
    shadows: bool = True
    terminator: bool = True
    crop: tuple[int, int, int, int] | None = None
    seed: int = 0
    normals: Normals = "file"

    def __post_init__(self) -> None:
        for name, low, high in (
            ("width", 1, MAX_SIZE),
            ("height", 1, MAX_SIZE),
            ("samples", 1, MAX_SAMPLES),
            ("seed", 0, 2**64 - 1),
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
                raise OptionError(name, f"a whole number from {low} to {high}", value, "render")
        texts = {"shading": Shading, "normals": Normals, "obscurance": ObscuranceForm}
        for name, allowed in ((name, get_args(texts[name])) for name in texts):
            value = getattr(self, name)
            if value not in allowed:
                raise OptionError(name, "one of " + ", ".join(allowed), value, "render", nearest_name(value, allowed))
        if self.crop is not None:
            expected = f"four whole numbers x, y, width, height in {self.width}×{self.height} pixels"
            check_type(self.crop, Sequence, "render", "crop", expected)
            if len(self.crop) != 4 or not all(isinstance(value, int) for value in self.crop):
                raise OptionError("crop", expected, self.crop, "render")
            x, y, width, height = self.crop
            inside = x >= 0 and y >= 0 and x + width <= self.width and y + height <= self.height
            if not (inside and width > 0 and height > 0):
                raise OptionError("crop", f"a part of {self.width}×{self.height} pixels", self.crop, "render")
