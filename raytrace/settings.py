"""Settings of a rendering: size, samples, interpolation, what is switched on."""

from __future__ import annotations

from typing import Annotated, Literal

from .errors import OptionError
from .system.parameters import Parameters, Seed
from .system.records import Within

Shading = Literal["constant", "flat", "gouraud", "phong", "quadratic"]
Normals = Literal["file", "angle", "area", "equal"]
ObscuranceForm = Literal["off", "ambient", "ambient and diffuse"]
MAX_SIZE = 32768
Pixels = Annotated[int, Within(1, MAX_SIZE)]
Samples = Annotated[int, Within(1, 4096)]
Crop = Annotated[tuple[int, int, int, int], "four whole numbers x, y, width, height"]


class Settings(Parameters, kw_only=False, source="render"):
    """Settings of a rendering.

    Attributes:
        width: in pixels.
        height: in pixels.
        samples: most rays a pixel; pixels whose first samples agree get no more.
        shading: interpolation over a face: constant (the textbook's, without specular terms), flat (constant with
            them), Gouraud, Phong, or quadratic (van Overveld & Wyvill).
        obscurance: what w(p) weights: "ambient" light alone; "ambient and diffuse" light, as in the textbook
            (12.75); "off": nothing.
        shadows: trace shadow rays for the visibility δ(p, j).
        terminator: move shadow rays' origins off a coarse mesh onto the smooth surface that its normals describe.
        crop: (x, y, width, height) in pixels from the upper left; only these are rendered.
        seed: of the pixel samples.
        normals: of vertices: "file", a mesh's own at corners where these are of use, and else "angle" and smooth but
            across edges of more than 30°; or means over the faces around a vertex, weighted by "angle" (12.33), "area"
            (12.32) or "equal" (12.31), whatever the mesh has.

    Raises:
        OptionError: a value out of range.
    """

    width: Pixels = 960
    height: Pixels = 640
    samples: Samples = 16
    shading: Shading = "phong"
    obscurance: ObscuranceForm = "ambient"
    shadows: bool = True
    terminator: bool = True
    crop: Crop | None = None
    seed: Seed = 0
    normals: Normals = "file"

    def check(self) -> None:
        if self.crop is not None:
            x, y, width, height = self.crop
            inside = x >= 0 and y >= 0 and x + width <= self.width and y + height <= self.height
            if not (inside and width > 0 and height > 0):
                raise OptionError("crop", f"a part of {self.width}×{self.height} pixels", self.crop, "render")
