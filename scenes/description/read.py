"""Any file that can be rendered, as a scene."""

import os
from dataclasses import replace
from pathlib import Path

from raytrace import Object, OptionError, Scene, Settings, Shape

from ..formats.load import load
from ..formats.table import format_of
from ..geometry.corners import split_creases
from ..geometry.primitives import Origin
from .description import BACKGROUND, NEUTRAL, WHITE, SceneDescription, framing, three_lights
from .textured import colours_left_out, linear_colours
from .toml_scene import read_toml


def read_scene(
    path: str | os.PathLike[str], size: tuple[int, int] | None = None, up: str | None = None, view: str | None = None
) -> SceneDescription:
    """A scene by the file's ending: `.toml` (docs/scenes.md), `.glb` or `.gltf`, or any other mesh alone.

    A mesh alone is matt, in the colours of its vertices or grey, framed whole, under three lights; what is up in it
    (`Mesh.up`) is up. Without normals it has those of `raytrace.mesh.normals`. One baked file of the mesh fits it.

    Args:
        path: the file.
        size: width and height of the picture in pixels in place of the file's own; automatic framing goes by it.
        up: "x", "y", "z", "-x", "-y" or "-z" in place of `Mesh.up`: where a mesh file is seen and lit from.
        view: "front", "back", "left", "right", "top", "bottom", or "X,Y,Z", from the mesh to the camera in the file's
            axes; in place of the file's own camera.

    Raises:
        SceneError: a fault of a scene file, with the path of the value.
        MeshError: a mesh or glTF file cannot be read.
        OptionError: `size` is out of range, or `up` or `view` is wrong or of no use.
    """
    path = Path(path)
    ending = path.suffix.lower()
    settings = Settings(*size) if size else Settings()
    if ending == ".toml":
        for name, given, own in (("--up", up, "up"), ("--view", view, "direction")):
            if given is not None:
                raise OptionError(name, f"a mesh file; a scene has camera.{own}", path)
        return read_toml(path, size)
    if "scene" in format_of(path).holds:
        from .gltf_scene import read_gltf

        return read_gltf(path, settings, up, view)
    source = load(path, names=True)
    colours = linear_colours(source.attributes)
    mesh = source.mesh
    origin = None
    if mesh.normals is None:
        rows, faces, normals, _ = split_creases(mesh)
        origin = Origin(rows, len(mesh.vertices))
        mesh = replace(mesh, vertices=mesh.vertices[rows], faces=faces, normals=normals)
        colours = None if colours is None else colours[rows]
    objects = (Object(Shape(mesh, NEUTRAL if colours is None else WHITE, colours=colours), name=path.stem),)
    camera = framing(source.mesh, up, settings.width, settings.height, view)
    lit = Scene(objects, three_lights(camera), BACKGROUND)
    notes = (*source.notes, *colours_left_out(path, source.unread))
    return SceneDescription(lit, camera, settings, files=source.files, notes=notes, origins=(origin,))
