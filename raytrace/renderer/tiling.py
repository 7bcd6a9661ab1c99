"""The tiles that a picture is made of: a grid from its upper left corner."""

from ..settings import Settings
from ..shade.film import TILE


def whole_tiles(settings: Settings) -> tuple[int, int, int, int]:
    """Left, top, width and height, in pixels, of what is rendered: the whole picture.

    For a crop, the tiles that it touches and their neighbours, whose pixels decide about pixels on its edges.
    """
    x, y, wide, high = settings.crop or (0, 0, settings.width, settings.height)
    left, top = max(x // TILE - 1, 0) * TILE, max(y // TILE - 1, 0) * TILE
    right = min((-(-(x + wide) // TILE) + 1) * TILE, settings.width)
    bottom = min((-(-(y + high) // TILE) + 1) * TILE, settings.height)
    return left, top, right - left, bottom - top


def tile_count(wide: int, high: int) -> int:
    return -(-wide // TILE) * -(-high // TILE)
