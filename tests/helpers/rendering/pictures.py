"""Pictures on disk as others see them."""

import subprocess
import sys

import OpenImageIO as oiio
import PIL.Image
from project import environment

from obscurance.raytrace.image.formats import FORMATS

ENDINGS = tuple(FORMATS)


PICTURES = [ending for ending in ENDINGS if ending != ".exr"]


def foreign(path):
    """The file as OpenImageIO reads it by itself: channel names, and floats."""
    image = oiio.ImageInput.open(str(path))
    return image.spec(), image.read_image("float")


def pillow(path):
    with PIL.Image.open(path) as picture:
        return picture.copy()


def python(code, *arguments):
    """Run code in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False, env=environment()
    )


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())
