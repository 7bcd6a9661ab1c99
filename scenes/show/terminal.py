"""A picture in a terminal."""

import numpy as np
import numpy.typing as npt
from rich.color import Color
from rich.console import Console
from rich.style import Style
from rich.text import Text

from obscurance.raytrace.image.colour import encode_srgb

from .page.base_colour import block_means


def show_picture(pixels: npt.NDArray[np.float32]) -> None:
    """Print a picture, linear RGB, in the terminal's colours, at most as wide: two pixels a character, in a column.

    Not the terminal writer of OpenImageIO, which prints `\\u2580` in these six letters instead of the half block.
    """
    console = Console()
    half, step = ("▀", 2) if "utf" in console.encoding.lower() else (" ", 1)
    height, width = pixels.shape[:2]
    wide = min(console.width, width)
    high = max(round(height * wide / width * step / 2 / step), 1) * step  # characters are twice as high as wide
    codes = (255 * encode_srgb(block_means(pixels[..., :3], high, wide).astype("f4")) + 0.5).astype(int)
    for lines in zip(*(codes[offset::step] for offset in range(step)), strict=True):
        text = Text(no_wrap=True, end="\n")
        for column in range(codes.shape[1]):
            upper = Color.from_rgb(*lines[0][column])
            lower = Color.from_rgb(*lines[-1][column])
            text.append(half, Style(color=upper, bgcolor=lower))
        console.print(text)
