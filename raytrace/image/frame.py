"""A rendered picture: its layers, counts of rays and seconds, and how it is saved."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..errors import OptionError
from ..system.atomic import PathName
from ..types import Float32s
from .formats import LAYERS, file_format
from .write import check_image_target, image_bytes, write_layers, write_picture


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture, as `raytrace.render` returns it.

    Attributes:
        layers: float32 (height, width, channels) for each name of `LAYERS`, row 0 at the top.
        rays: traced, by kind: primary, shadow.
        rays_skipped: shadow rays not traced, by reason.
        seconds: build, render.
        corner: column and row of the first pixel in the whole picture, of a crop.
        background: linear RGB that is in the beauty already wherever the coverage is below 1.
    """

    layers: dict[str, Float32s]
    rays: dict[str, int]
    rays_skipped: dict[str, int]
    seconds: dict[str, float]
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    corner: tuple[int, int] = (0, 0)

    def __repr__(self) -> str:
        height, width = self.layers["beauty"].shape[:2]
        rays = ", ".join(f"{count:,} {kind}" for kind, count in self.rays.items())
        return f"<Frame {width}×{height}: {', '.join(self.layers)}; rays: {rays}>"

    def _repr_png_(self) -> bytes:
        """The beauty as a PNG: what notebooks show."""
        return image_bytes("frame.png", write_picture, self.layers["beauty"], {}, any(self.background), self.corner)

    def save(
        self,
        path: PathName,
        metadata: Mapping[str, str] | None = None,
        half: bool = False,
        layers: Sequence[str] | None = None,
    ) -> None:
        """Write the picture in the format of the ending: .exr .png .tif .jpg

        An EXR file holds R, G, B, A of the beauty and `layer.channel` of every other layer: R, G, B of colours; X, Y, Z
        of normals; Z of depth; ID of object_id; Y of the rest. In the other formats the beauty has straight alpha
        (JPEG: none, over black); a background other than black, which is in the beauty already, makes it opaque.
        Only some rows are held in memory besides the frame.

        Args:
            path: the target, replaced if it exists, whole or not at all.
            metadata: names and texts, such as the scene and the seed: attributes `obscurance:name` in EXR and PNG, a
                JSON object as the image description in TIFF and JPEG. `read_image` returns them.
            half: 16-bit floats in EXR (magnitudes above 65504 are clipped); depth and object_id stay 32-bit.
            layers: which to write; all of the frame's in EXR, the beauty in other formats.

        Raises: OptionError: an ending or a layer that cannot be written, or that the frame lacks. OutputError.
        """
        chosen = check_image_target(path, half, layers)
        facts = metadata or {}
        for name in chosen or ():
            if name not in self.layers:
                raise OptionError("layers", "layers of the frame: " + ", ".join(self.layers), name)
        if file_format(path) == "openexr":
            names = chosen or [name for name in LAYERS if name in self.layers]
            write_layers(path, {name: self.layers[name] for name in names}, facts, half)
        else:
            (name,) = chosen or ("beauty",)
            write_picture(path, self.layers[name], facts, any(self.background), self.corner)
