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


def refined_glb(source: Asset, cuts: Sequence[Cuts]) -> bytes:
    """A glTF source as stored, a mesh of its own for each instance, after cuts of the faces of its mesh.

    Raises: MeshError: it has a skin, as joints of two vertices have no mean.
    """
    raw = source.raw
    assert isinstance(raw, Gltf)
    builder, drawn = stored_document(raw, source.parts)
    stored = Gltf(source.path, builder.header, [bytes(builder.binary)])
    for (primitive, _, _), part, own in zip(drawn, source.parts, cuts_of_parts(source, cuts), strict=True):
        if any(name.startswith("JOINTS_") for name in primitive["attributes"]):
            raise MeshError(source.path, "JOINTS_0", "a mesh without a skin, to be cut by --between", "one")
        faces, extended = cut_rows(part.primitive.faces, len(part.primitive.positions), own)

        def change(name: str, rows: Array, extended: Callable[[Array], Array] = extended) -> Array:
            more = extended(rows)
            if name in _UNIT and more.dtype.kind == "f":
                more[:, :3] = normalize(more[:, :3])
            return more

        change_vertices(builder, stored, primitive, change)
        draw(builder, primitive, faces if part.node.volume > 0 else faces[:, ::-1])
    return builder.encode()
