"""An image of a baked mesh with a dot on every flagged vertex, hidden or not."""

from pathlib import Path

import numpy as np

import ao
from raytrace import AmbientLight, Camera, Lambert, Mesh, Object, Scene, Settings, Shape, render
from raytrace.image.write import write_image
from raytrace.types import Float32s, Float64s

from ...description.defaults import framing

COLOURS = {
    ao.Flag.CONTACT: (1.0, 1.0, 1.0),
    ao.Flag.UNREFERENCED: (0.1, 0.3, 1.0),
    ao.Flag.DEGENERATE: (1.0, 0.8, 0.0),
    ao.Flag.OPPOSED: (0.0, 0.8, 0.9),
    ao.Flag.FOLDED: (0.1, 0.8, 0.1),
    ao.Flag.HIDDEN: (1.0, 0.0, 0.6),
    ao.Flag.MISSED: (1.0, 0.25, 0.0),
}
"""Linear RGB of the dot on a vertex: white, blue, yellow, cyan, green, magenta, orange; the last one wins."""

_WIDTH, _HEIGHT, _DOT = 960, 720, 2


def write_marked(target: Path, mesh: Mesh, baked: ao.Bake, up: str | None = None) -> None:
    """Write the mesh in ambient light times w, with a dot on each flagged vertex. Args: up: in place of `Mesh.up`.

    Raises:
        OptionError: not the ending of a picture. OutputError: the file cannot be written.
    """
    camera = framing(mesh, up, _WIDTH, _HEIGHT)
    white = Object(Shape(mesh, Lambert(albedo=(1, 1, 1), two_sided="viewer")), w=baked.w)
    scene = Scene((white,), (AmbientLight(intensity=(1, 1, 1)),), (0.05, 0.05, 0.05))
    frame = render(scene, camera, Settings(width=_WIDTH, height=_HEIGHT), layers=False)
    picture = np.array(frame.layers["beauty"][..., :3])
    for flag, colour in COLOURS.items():
        _dots(picture, camera, mesh.vertices[(baked.flags & flag) != 0], colour)
    write_image(target, picture)


def _dots(picture: Float32s, camera: Camera, places: Float64s, colour: tuple[float, float, float]) -> None:
    right, above, forward = camera.axes()
    offset = places - camera.position
    depth = offset @ forward
    offset, depth = offset[depth > 0], depth[depth > 0]
    half = np.tan(np.radians(camera.field_of_view / 2)) * depth
    x = (offset @ right / half * _HEIGHT + _WIDTH) / 2
    y = (_HEIGHT - offset @ above / half * _HEIGHT) / 2
    for dy in range(-_DOT, _DOT + 1):
        for dx in range(-_DOT, _DOT + 1):
            i, j = np.floor(y + dy).astype(int), np.floor(x + dx).astype(int)
            inside = (i >= 0) & (i < _HEIGHT) & (j >= 0) & (j < _WIDTH)
            picture[i[inside], j[inside]] = colour
