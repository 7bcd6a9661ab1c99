"""Names of images that textures are baked to."""

import os
from pathlib import Path

ENDINGS = (".png", ".exr", ".tif", ".tiff")
UDIM = "<UDIM>"
"""Placeholder of a tile's number in the name of an output."""
MATERIAL, OBJECT = "<MATERIAL>", "<OBJECT>"
"""Placeholders of their names."""
PLACEHOLDERS = UDIM, MATERIAL, OBJECT


def is_texture(path: str | os.PathLike[str]) -> bool:
    """Whether a name is that of an image."""
    return Path(path).suffix.lower() in ENDINGS
