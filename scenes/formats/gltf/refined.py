"""A glTF document whose faces are cut, with all else that it has."""

from collections.abc import Callable, Sequence

from obscurance.ao.refine import Cuts
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.normals import normalize

from ...asset.asset import Asset
from ...asset.primitive import Array
from ...asset.refined import cut_rows, cuts_of_parts
from .asset import Gltf
from .textured import change_vertices, draw
from .write import stored_document

_UNIT = "NORMAL", "TANGENT"


def check_no_skin(source: Asset) -> None:
    """Check that faces can be cut: joints of two vertices have no mean. Raises: MeshError: a glTF has a skin."""
    if isinstance(source.raw, Gltf) and any(drawn.skin is not None for drawn in source.raw.drawn):
        raise MeshError(source.path, "skin", "none, where faces are cut between vertices", "one")


def refined_glb(source: Asset, cuts: Sequence[Cuts]) -> bytes:
    """A glTF source as stored, a mesh of its own for each instance, after cuts of the faces of its mesh."""
    raw = source.raw
    assert isinstance(raw, Gltf)
    builder, drawn = stored_document(raw, source.parts)
    stored = Gltf(source.path, builder.header, [bytes(builder.binary)])
    for (primitive, _, _), part, own in zip(drawn, source.parts, cuts_of_parts(source, cuts), strict=True):
        faces, extended = cut_rows(part.primitive.faces, len(part.primitive.positions), own)

        def change(name: str, rows: Array, extended: Callable[[Array], Array] = extended) -> Array:
            more = extended(rows)
            if name in _UNIT and more.dtype.kind == "f":
                more[:, :3] = normalize(more[:, :3])
            return more

        change_vertices(builder, stored, primitive, change)
        draw(builder, primitive, faces if part.node.volume > 0 else faces[:, ::-1])
    return builder.encode()
