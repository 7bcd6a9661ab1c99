"""Albedo textures: where one comes from. What it looks like is read only when a ray has seen it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Texture:
    """An image file, or the bytes of one (a GLB keeps its images inside).

    Attributes:
        path: the file, or what to call the image in messages when `data` is given.
        data: the file's content, or None to read `path`.
        srgb: whether its values are sRGB-encoded, as colour textures are.
    """

    path: Path
    data: bytes | None = None
    srgb: bool = True
