"""Texture coordinates for meshes that have none: unwrapping by the library uvunwrap, an optional extra."""

from typing import Any

import numpy as np

from ao.texture.uv_layout import MAX_SIDE
from raytrace.errors import MeshError, OptionError
from raytrace.mesh.convert import mesh_of
from raytrace.mesh.mesh import Mesh
from raytrace.types import Float64s

_PADDING = 4  # texels between charts, so that neither bilinear lookups nor one coarser level see two of them
_LEAST = 64  # texels across, below which there is no room for charts


def has_unwrapper() -> bool:
    from importlib.util import find_spec

    return find_spec("uvunwrap") is not None


def unwrap(mesh: Mesh | Any, size: int = 1024) -> Float64s:
    """New texture coordinates (m, 3, 2) without overlaps, v upwards; the same mesh and size give the same.

    Args:
        mesh: as `ao.bake` takes it.
        size: texels across the square page that they are for, 64 to 16384.

    Raises:
        OptionError: the library is not installed, or the page is smaller than 64 texels.
        MeshError: the library fails.
    """
    if not has_unwrapper():
        raise OptionError("uv", "pip install uvunwrap, to unwrap meshes", "no uvunwrap")
    if not _LEAST <= size <= MAX_SIDE:
        raise OptionError("size", f"{_LEAST} to {MAX_SIDE} texels, to unwrap for", size)
    import uvunwrap

    mesh = mesh_of(mesh, "unwrap")
    centred = (mesh.vertices - mesh.centre) / max(mesh.radius, 1e-300)
    try:
        given = uvunwrap.Mesh(centred.astype(np.float32).ravel(), mesh.faces.astype(np.uint32).ravel())
        atlas = uvunwrap.generate([given], page_size=size, padding=_PADDING)
    except Exception as reason:
        raise MeshError(mesh.source, "faces", "a mesh that uvunwrap can unwrap", reason) from None
    uv = np.asarray(atlas.meshes[0].corner_uvs, np.float64).reshape(-1, 3, 2)
    if atlas.page_count > 1:
        got = f"{atlas.page_count} pages of {size} texels; a larger --size may do"
        raise MeshError(mesh.source, "faces", "a mesh that uvunwrap can unwrap to one page", got)
    if atlas.page_count != 1 or len(uv) != len(mesh.faces) or not np.isfinite(uv).all():
        raise MeshError(mesh.source, "faces", "a mesh that uvunwrap can unwrap", f"{atlas!r}")
    return uv
