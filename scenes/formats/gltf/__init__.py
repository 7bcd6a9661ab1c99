"""glTF 2.0: JSON with files beside it, .gltf, and binary, .glb, in which bakes are written."""

from ..table import FileFormat, register

_READ = "obscurance.scenes.formats.gltf.read:read_gltf"

register(
    FileFormat(
        ".glb",
        "GLB",
        read=_READ,
        peak=2.0,
        begins=rb"glTF",
        write="obscurance.scenes.formats.gltf.write:glb",
        holds=("source", "w", "colors", "scene"),
        unit=1.0,
    ),
    FileFormat(".gltf", "glTF", read=_READ, peak=2.0, begins=rb"\s*\{", holds=("w", "scene"), unit=1.0),
)
