"""Any file that can be rendered, as a scene."""

from pathlib import Path

from obscurance.raytrace import OptionError, Settings
from obscurance.raytrace.system.atomic import PathName

from .description import SceneDescription
from .mesh_scene import mesh_scene, read_source
from .toml_scene import read_toml


def read_scene(
    path: PathName, size: tuple[int, int] | None = None, up: str | None = None, view: str | None = None
) -> SceneDescription:
    """A scene by the file's ending: `.toml` (docs/scenes.md), `.glb` or `.gltf`, or any other mesh alone.

    A mesh alone is in its materials and textures, in the colours of its vertices, or a matt grey, framed whole, under
    three lights; what is up in it (`Mesh.up`) is up. Without normals it has those of `raytrace.mesh.normals`. One baked
    file of the mesh fits it.

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
        for name, value, key in (("--up", up, "up"), ("--view", view, "direction")):
            if value is not None:
                raise OptionError(name, f"a mesh file; a scene has camera.{key}", path)
        return read_toml(path, size)
    return mesh_scene(read_source(path), settings, up, view)
