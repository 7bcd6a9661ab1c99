"""A rendered picture: its layers, counts of rays and seconds."""

from dataclasses import dataclass

from ..types import Float32s
from .encode import write_picture, written

LAYERS = {
    "beauty": 4, "ambient": 3, "diffuse": 3, "specular": 3, "emission": 3,
    "obscurance": 1, "shadow": 1, "depth": 1, "normal": 3, "albedo": 3, "object_id": 1,
}  # fmt: skip
"""Channels of each layer.

beauty is RGBA, linear, colour premultiplied by coverage; its RGB is ((ambient + diffuse) + specular) + emission in
float32. The background counts as emission, also what shows of it through transparent surfaces. shadow is the part of
the light that δ lets through (1 lit); depth the distance to the camera, inf where nothing was hit; normal a world
vector; object_id the object's row plus 1, 0 for none. depth, normal and object_id are the nearest sample's of a pixel,
all others means.
"""


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture, as `raytrace.render` returns it.

    Attributes:
        layers: float32 (height, width, channels) for each name of `LAYERS`, row 0 at the top.
        rays: traced, by kind: primary, shadow.
        rays_skipped: shadow rays not traced, by reason.
        seconds: build, render.
        background: linear RGB that is in the beauty already wherever the coverage is below 1.
    """

    layers: dict[str, Float32s]
    rays: dict[str, int]
    rays_skipped: dict[str, int]
    seconds: dict[str, float]
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __repr__(self) -> str:
        height, width = self.layers["beauty"].shape[:2]
        rays = ", ".join(f"{count:,} {kind}" for kind, count in self.rays.items())
        return f"<Frame {width}×{height}: {', '.join(self.layers)}; rays: {rays}>"

    def _repr_png_(self) -> bytes:
        """The beauty as a PNG: what notebooks show."""
        return written("frame.png", write_picture, self.layers["beauty"], {}, any(self.background))
