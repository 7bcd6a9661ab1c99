"""Warnings of what an output format cannot keep of the mesh file."""

from pathlib import Path
from pkgutil import resolve_name

from raytrace.errors import printable

from .load import MeshFile
from .ply.write import has_own_colors
from .ply.write import unsupported_features as unsupported_of_ply
from .table import Channels, format_of


def left_out(mesh_file: MeshFile, _: str = "") -> list[str]:
    """What of a mesh file a format lacks that holds w, polygons, texture coordinates and normals alone, in words."""
    numbers = mesh_file.attributes.numbers if mesh_file.attributes else ()
    return [*unsupported_of_ply(mesh_file, "rgb"), *(f"{name} of vertices" for name in numbers)]


def unsupported_features(target: Path, mesh_file: MeshFile, channels: Channels = Channels()) -> list[str]:
    """Losses of `scenes.write`, and unexpected changes: lines for the user, mostly none.

    Raises: OptionError: coordinates that the format does not hold. MeshError: colours to be kept are malformed.
    """
    row = format_of(target)
    colors = channels.colors
    if not row.unsupported:
        return []
    missing = resolve_name(row.unsupported)(mesh_file, colors)
    warnings = [f"{target}: not kept from {mesh_file.path}: {', '.join(missing)}"] if missing else []
    if row.name == "PLY" and not colors and has_own_colors(mesh_file.attributes):
        instead = "w, the openness, is only in the property obscurance; --colors puts it in their place"
        warnings.append(f"{target}: keeps the colours of {mesh_file.path}; {instead}")
    if channels.ply_name and mesh_file.attributes and channels.ply_name in mesh_file.attributes.numbers:
        warnings.append(f"{target}: w takes the place of {channels.ply_name} of {mesh_file.path}")
    if channels.ramp and mesh_file.gltf:
        from .gltf.write import ramp_warnings

        warnings += [f"{target}: {line}" for line in ramp_warnings(mesh_file.gltf, channels.replace)]
    return [printable(line) for line in warnings]
