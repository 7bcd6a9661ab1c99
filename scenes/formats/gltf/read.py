"""The triangles that a glTF scene draws at rest, with the transforms of their nodes (Khronos glTF 2.0, section 3.7)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.raytrace.errors import MeshError

from ...asset.asset import Asset, Node
from ...asset.primitive import BAKED, COLOR, NORMAL, RAMP, Column, ColumnSet, Lazy, Primitive
from ...geometry.instances import check_copies
from ..table import MeshInput
from .accessors import column, flipped, normalized, triangles, values, vectors
from .asset import DrawnPrimitive, Gltf, decode, entry
from .draco import decompressed
from .occlusion import ramp_sets
from .pose import Posed, Poses, in_words
from .records import LEFT, PROFILE, TRANSMISSION, TRIANGLE_MODES

if TYPE_CHECKING:
    from obscurance.ao import Profile

    from ...asset.material import Material

_COPIES = "EXT_mesh_gpu_instancing"
_UV = "TEXCOORD_"
_READ = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", *LEFT.values())
_WORDS = {
    "materials": "materials", "textures": "textures", "animations": "animations", "skins": "skins",
    "cameras": "cameras", "extensionsUsed": "extensions",
}  # fmt: skip


def read_gltf(mesh_input: MeshInput) -> Asset:
    """The triangle primitives that a file draws, in the order of `Gltf.drawn`, each shape once.

    Raises: ValueError: as `decode` and `Poses`, compressed values, very many copies, nodes that are no tree.
    """
    raw = decompressed(decode(mesh_input.file.read(), mesh_input.path))
    poses = Poses(raw)
    primitives: dict[Any, tuple[int, Primitive, Posed]] = {}
    nodes: list[Node] = []
    notes = dict.fromkeys(in_words(raw))
    copied = 0
    for drawn in raw.drawn:
        if drawn.shape not in primitives:
            primitives[drawn.shape] = (len(primitives), *_primitive(raw, drawn, poses))
        number, primitive, posed = primitives[drawn.shape]
        copied += len(primitive.positions) + len(primitive.sizes)
        check_copies(copied, sum(map(len, raw.buffers)), raw.path)
        # Its node, named after itself or its mesh, which places it unless a skin has done so.
        stored = raw.geometry.nodes[drawn.node]
        name = stored.name or raw.geometry.meshes[drawn.mesh].name or f"node {drawn.node}"
        if _COPIES in stored.extensions:
            notes[f"{name}{primitive.name} is drawn many times by {_COPIES}, which is not read: once here"] = None
        matrix = raw.world[drawn.node] if drawn.skin is None else posed.matrix
        if nodes and nodes[-1].stored == drawn.node and (nodes[-1].matrix is matrix or drawn.skin is None):
            nodes[-1] = nodes[-1]._replace(primitives=(*nodes[-1].primitives, number))
        else:  # also for a primitive that a skin mirrors beside others that it does not
            nodes.append(Node(name, (number,), matrix, drawn.mesh, drawn.node))
    return Asset(
        mesh_input.path,
        tuple(primitive for _, primitive, _ in primitives.values()),
        tuple(nodes),
        Lazy(partial(_materials, raw, notes)),
        up="y",
        warnings=notes,
        unread=_unread(raw),
        raw=raw,
        has_alpha=mesh_input.alpha and _has_alpha(raw),
    )


def _materials(raw: Gltf, notes: dict[str, None]) -> tuple[Material, ...]:
    from .textures import Textures

    return tuple(Textures(raw, notes).materials())


def _has_alpha(raw: Gltf) -> bool:
    """Whether some material may not be opaque; opaque ones are not read."""
    materials = raw.header.get("materials", [])
    tables = [table for table in materials if isinstance(table, dict)] if isinstance(materials, list) else []
    return any(
        table.get("alphaMode", "OPAQUE") != "OPAQUE" or TRANSMISSION in table.get("extensions", ()) for table in tables
    )


def _unread(raw: Gltf) -> tuple[str, ...]:
    """What a file holds that others than glTF cannot, in words."""
    modes = {primitive.mode for mesh in raw.geometry.meshes for primitive in mesh.primitives}
    words = ["nodes"] * (len(raw.drawn) > 1) + ["points and lines"] * (not modes <= {*TRIANGLE_MODES})
    words += [words for key, words in _WORDS.items() if raw.header.get(key)]
    names = [drawn.primitive.attributes.keys() - _ramps(raw, drawn) for drawn in raw.drawn]
    return (*words, *sorted(set[str]().union(*names) - set(_READ)))


def _ramps(raw: Gltf, drawn: DrawnPrimitive) -> set[str]:
    """The texture coordinates of a primitive by which an earlier bake looks up its ramp."""
    with suppress(TypeError, AttributeError, KeyError):  # whoever uses malformed materials refuses them
        return {f"{_UV}{number}" for number in ramp_sets(raw.header, drawn.stored)}
    return set()


def _primitive(raw: Gltf, drawn: DrawnPrimitive, poses: Poses) -> tuple[Primitive, Posed]:
    """A primitive as it is posed."""
    stored = drawn.primitive
    attributes = stored.attributes
    if "POSITION" not in attributes:
        raise ValueError("a primitive without POSITION")
    positions = vectors(raw, attributes["POSITION"])
    accessor = raw.geometry.accessors[attributes["POSITION"]]
    if accessor.bufferView is None and accessor.sparse is None:  # zeros, of which there is nothing to see
        raise MeshError(raw.path, "POSITION", "uncompressed values", "no data")
    normals = vectors(raw, attributes["NORMAL"]) if "NORMAL" in attributes else None
    posed = poses.posed(drawn, Posed(positions, normals))
    corners = triangles(raw, stored, len(positions)).ravel()
    columns = _columns(raw, drawn)
    if posed.normals is not None:
        columns |= {NORMAL: Column(posed.normals)}
    several = len(raw.geometry.meshes[drawn.mesh].primitives) > 1
    primitive = Primitive.of(
        posed.vertices,
        corners,
        columns=columns,
        material=None if stored.material is None else np.broadcast_to(np.int64(stored.material), len(corners) // 3),
        profile=_stored_profile(raw, attributes, len(positions)),
        name=f"[{drawn.primitive_number}]" if several else "",
    )
    return primitive, posed


def _columns(raw: Gltf, drawn: DrawnPrimitive) -> ColumnSet:
    """Texture coordinates, colours and w of an earlier bake, read when they are used."""
    columns: dict[str, Column | Callable[[], Column]] = {}
    ramps = _ramps(raw, drawn)
    for name in drawn.primitive.attributes:
        if name.startswith(_UV):
            key = (RAMP if name in ramps else "uv") + name.removeprefix(_UV)
            columns[key] = partial(_column, raw, drawn, name, "VEC2")
        elif name == "COLOR_0":
            columns[COLOR] = partial(_column, raw, drawn, name, "VEC3", "VEC4")
    count = entry(raw.geometry.accessors, drawn.primitive.attributes["POSITION"], "accessors").count
    for name, attribute in LEFT.items():
        with suppress(KeyError, ValueError):  # unless the attribute of that name is something else
            left = values(raw, drawn.primitive.attributes[attribute], "SCALAR", "VEC3")
            is_vector = name == BAKED["bent_normals"]
            if len(left) == count and left.dtype.kind == "f" and left.shape[1] == (3 if is_vector else 1):
                columns[name] = Column(left if is_vector else left.ravel())
    return ColumnSet(columns)


def _column(raw: Gltf, drawn: DrawnPrimitive, name: str, *kinds: str) -> Column:
    """An attribute as a column. Raises: MeshError: values that are not finite, or not one for each vertex."""
    try:
        stored = column(raw, drawn.primitive, name, *kinds)
    except (ValueError, KeyError, TypeError) as reason:
        expected = "two numbers a vertex" if name.startswith(_UV) else "three or four numbers a vertex"
        raise MeshError(raw.path, name, expected, reason) from None
    assert stored is not None
    return Column(flipped(stored) if name.startswith(_UV) else stored)


def _stored_profile(raw: Gltf, attributes: dict[str, int], count: int) -> Profile | None:
    """The profile of an earlier bake, unless the attributes of these names are something else."""
    with suppress(KeyError, TypeError, ValueError):
        extras = entry(raw.geometry.accessors, attributes[f"{PROFILE}0"], "accessors").extras
        lengths = extras["half_distances"]
        numbers = [attributes[f"{PROFILE}{number}"] for number in range(-(-len(lengths) // 4))]
        columns = np.hstack([normalized(values(raw, number, "VEC4")) for number in numbers])
        if len(columns) == count:
            from obscurance.ao import Profile

            return Profile.stored(lengths, columns[:, : len(lengths)], extras["radius"], extras.get("max_distance"))
    return None
