"""Pictures of bakes, as on a page, with the error in colours or flagged vertices; of textures; of rendered layers."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from obscurance import ao
from obscurance.ao.texture.uv_layout import on_page
from obscurance.raytrace import (
    AmbientLight,
    Camera,
    Frame,
    Lambert,
    Mesh,
    Object,
    Occlusion,
    Scene,
    Settings,
    Shape,
    Texture,
)
from obscurance.raytrace import render as render_scene
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.write import image_bytes, write_data, write_image
from obscurance.raytrace.types import AnyFloats, Float32s, Float64s

from ...description.description import framing
from ..look import BACKGROUND, FIELD_OF_VIEW, HEAT, clay_scene, clay_settings
from ..page.base_colour import block_means

_WIDTH, _HEIGHT = 480, 400
_SAMPLES = 8
_LARGEST = 512  # side of a texture's page or a rendering as shown
_LAYERS = ("beauty", "ambient", "diffuse", "specular", "emission", "obscurance", "shadow", "normal", "albedo")


class Picture(NamedTuple):
    title: str
    png: bytes
    top: float | None = None  # the largest error, if it shows errors


def pictures_of_vertices(mesh: Mesh, w: AnyFloats, error: AnyFloats) -> list[Picture]:
    """A bake at the vertices: clay × w, w, and the error. Args: w, error: (n,)."""
    camera = _camera(mesh)
    top = float(np.max(error, initial=0.0))
    clay = render_scene(clay_scene(mesh, w, camera), camera, clay_settings(_WIDTH, _HEIGHT, _SAMPLES), layers=False)
    shown = (np.asarray(values, np.float64) for values in (w, error / (top or 1.0)))
    objects = [Object(Shape(mesh, _WHITE), w=values) for values in shown]
    return [Picture("clay × w", _png(clay.layers["beauty"][..., :3])), *_w_and_error(objects, camera, top)]


def pictures_of_faces(mesh: Mesh, w: AnyFloats, error: AnyFloats) -> list[Picture]:
    """A bake at the faces, as `pictures_of_vertices` shows it. Args: w, error: (m,)."""
    corners = np.arange(3 * len(w)).reshape(-1, 3)
    apart = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), corners, source=mesh.source, up=mesh.up)
    return pictures_of_vertices(apart, np.repeat(w, 3), np.repeat(error, 3))


def pictures_of_page(mesh: Mesh | None, page: ao.BakedTexture) -> list[Picture]:
    """A page of a texture, and how the faces that are on it look with it if the mesh is given."""
    top = float(np.max(page.error, initial=0.0))
    share = page.error / (top or 1.0)
    shown = [
        Picture("the page: w", _png(_shrunk(page.w[..., None].astype(np.float32)))),
        Picture("the page: error", _png(decode_srgb(heat(_shrunk(share[..., None].astype(np.float32))[..., 0]))), top),
    ]
    if mesh is None:
        return shown
    camera = _camera(mesh)
    objects = [Object(_textured(mesh, page.uv, values)) for values in (page.w, share)]
    return _w_and_error(objects, camera, top) + shown


def pictures_of_frame(frame: Frame) -> list[Picture]:
    """The layers of a rendering that are colours, as far as it has them."""
    layers = {name: _shrunk(frame.layers[name]) for name in _LAYERS if name in frame.layers}
    return [
        Picture(name, _png(decode_srgb(0.5 + 0.5 * layer) if name == "normal" else layer[..., :3]))
        for name, layer in layers.items()
    ]


def heat(share: AnyFloats) -> Float32s:
    """sRGB (…, 3) of values (…,) in [0, 1] in the colours of a page's error."""
    stops = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in HEAT]) / 255
    at = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(share, at, channel) for channel in stops.T], axis=-1).astype(np.float32)


_WHITE = Lambert(albedo=(1, 1, 1), two_sided="viewer")


def _camera(mesh: Mesh) -> Camera:
    return Camera.framing(mesh, aspect=_WIDTH / _HEIGHT, field_of_view=FIELD_OF_VIEW)


def _values(item: Object, camera: Camera) -> tuple[Float32s, Float32s]:
    """The object's w in the picture times its coverage, and the coverage, each (h, w, 1)."""
    scene = Scene((item,), (AmbientLight(intensity=(1, 1, 1)),))
    settings = Settings(width=_WIDTH, height=_HEIGHT, samples=_SAMPLES, shadows=False)
    beauty = render_scene(scene, camera, settings, layers=False).layers["beauty"]
    return beauty[..., :1], beauty[..., 3:]


def _w_and_error(objects: list[Object], camera: Camera, top: float) -> list[Picture]:
    """Pictures of a mesh with w, and with the error by colours, on a page's background.

    Args:
        objects: one with w, and one with the error over `top` in its place.
    """
    w, coverage = _values(objects[0], camera)
    error, covered = _values(objects[1], camera)
    share = np.divide(error, covered, out=np.zeros_like(error), where=covered > 0)[..., 0]
    behind = np.array(BACKGROUND["dark"], np.float32)
    hot = decode_srgb(heat(share)) * covered + (1 - covered) * behind
    return [Picture("w", _png(w + (1 - coverage) * behind)), Picture("error", _png(hot), top)]


def _textured(mesh: Mesh, uv: Float64s, values: AnyFloats) -> Shape:
    """A shape whose corners are vertices of their own, with a page of values in [0, 1] as its occlusion texture."""
    shown = on_page(uv)
    corners = uv[shown]
    drawn = mesh.faces[shown]
    normals = None if mesh.normals is None else mesh.normals[drawn].reshape(-1, 3)
    faces = np.arange(drawn.size).reshape(-1, 3)
    apart = Mesh(mesh.vertices[drawn].reshape(-1, 3), faces, normals, source=mesh.source)
    content = image_bytes("values.png", write_data, values[..., None].astype(np.float32), {}, False, "Y")
    texture = Texture(Path("values.png"), content, srgb=False)
    return Shape(apart, _WHITE, occlusion=Occlusion(corners.reshape(-1, 2), texture))


def _shrunk(layer: Float32s) -> Float32s:
    """A picture of at most `_LARGEST` pixels a side, by means over blocks of pixels."""
    size = -(-max(layer.shape[:2]) // _LARGEST)
    return block_means(layer, *(-(-side // size) for side in layer.shape[:2])).astype(np.float32)


def _png(linear: AnyFloats) -> bytes:
    return image_bytes("picture.png", write_image, linear)


_DOTS = {
    ao.Flag.CONTACT: (1.0, 1.0, 1.0),
    ao.Flag.UNREFERENCED: (0.1, 0.3, 1.0),
    ao.Flag.DEGENERATE: (1.0, 0.8, 0.0),
    ao.Flag.OPPOSED: (0.0, 0.8, 0.9),
    ao.Flag.FOLDED: (0.1, 0.8, 0.1),
    ao.Flag.HIDDEN: (1.0, 0.0, 0.6),
    ao.Flag.MISSED: (1.0, 0.25, 0.0),
}
"""Linear RGB of the dot on a vertex: white, blue, yellow, cyan, green, magenta, orange; the last one wins."""


def write_marked(target: Path, mesh: Mesh, baked: ao.Bake) -> None:
    """Write the mesh in ambient light times w, with a dot on each flagged vertex, hidden or not."""
    settings = Settings(width=960, height=720)
    camera = framing(mesh, None, settings.width, settings.height)
    scene = Scene((Object(Shape(mesh, _WHITE), w=baked.w),), (AmbientLight(intensity=(1, 1, 1)),), (0.05, 0.05, 0.05))
    picture = np.array(render_scene(scene, camera, settings, layers=False).layers["beauty"][..., :3])
    for flag, colour in _DOTS.items():
        _dot(picture, camera, mesh.vertices[(baked.flags & flag) != 0], colour)
    write_image(target, picture)


def _dot(picture: Float32s, camera: Camera, points: Float64s, colour: tuple[float, float, float]) -> None:
    """Draw dots of 5 × 5 pixels at points (k, 3) into a picture that `camera` sees."""
    height, width = picture.shape[:2]
    right, above, forward = camera.axes()
    offset = points - camera.position
    depth = offset @ forward
    offset = offset[depth > 0]
    depth = depth[depth > 0]
    half = np.tan(np.radians(camera.field_of_view / 2)) * depth
    x = (offset @ right / half * height + width) / 2
    y = (height - offset @ above / half * height) / 2
    near = np.arange(-2, 3)[:, None]
    i, j = np.broadcast_arrays(np.floor(y + near[:, None]), np.floor(x + near))
    inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
    picture[i[inside].astype(int), j[inside].astype(int)] = colour
