"""The pose in which viewers show a glTF mesh at rest: default weights of morph targets, then the joints of skins.

vertex = Σ_k weight_k · jointWorld_k · inverseBind_k · (position + Σ_t weight_t · delta_t), weights of joints over their
sum; normals by the inverse transpose of the blended matrix. The transform of a skinned node itself is ignored.
Format: Khronos glTF 2.0 specification, sections 3.7.2.2 (morph targets) and 3.7.3 (skins).
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.types import Float64s

from ...geometry.instances import MAX_COPIED, cofactors
from .accessors import column, values, vectors
from .asset import DrawnPrimitive, Gltf, entry

_BLOCK = 1 << 14  # vertices at a time
_MIRROR = np.array([-1.0, 1.0, 1.0])


class Posed(NamedTuple):
    """Vertices and normals (n, 3) of a primitive, and where a skin places them."""

    vertices: npt.NDArray[Any]
    normals: npt.NDArray[Any] | None
    matrix: Float64s | None = None  # (4, 4), to the world; None: that of the node


@dataclass(eq=False)
class Poses:
    """The poses of an asset's primitives.

    Raises: MeshError: weights of another number than the targets, values of another number than the vertices, joints or
        weights that are missing, negative or out of range, inverse bind matrices of a wrong number or type, joints that
        are no nodes of a tree, or very many values by few bytes. ValueError: as `accessors.values`.
    """

    asset: Gltf
    _moved: int = 0
    _skins: dict[int, Float64s] = field(default_factory=dict)

    def posed(self, drawn: DrawnPrimitive, stored: Posed) -> Posed:
        """A primitive, given in its own frame, posed: there, or with a skin in the world, mirrored if its joints do."""
        at = f"meshes[{drawn.mesh}].primitives[{drawn.primitive_number}]"
        targets = drawn.primitive.targets
        weights = drawn.weights
        if weights and len(weights) != len(targets):
            is_own = self.asset.geometry.nodes[drawn.node].weights
            whose = f"nodes[{drawn.node}].weights" if is_own else f"meshes[{drawn.mesh}].weights"
            expected = f"{len(targets)} numbers, one a morph target of {at}"
            raise MeshError(self.asset.path, whose, expected, len(weights))
        vertices = self._morphed(drawn, "POSITION", stored.vertices, at)
        normals = None if stored.normals is None else self._morphed(drawn, "NORMAL", stored.normals, at)
        posed = stored._replace(vertices=vertices, normals=normals)
        return posed if drawn.skin is None else self._skinned(drawn.skin, drawn, posed, f"{at}.attributes")

    def _morphed(self, drawn: DrawnPrimitive, name: str, values: npt.NDArray[Any], at: str) -> npt.NDArray[Any]:
        """An attribute's values moved by its morph targets. Args: at: the primitive's path, for messages."""
        weight_of: dict[int, float] = {}  # by accessor
        for weight, target in zip(drawn.weights, drawn.primitive.targets, strict=False):
            if weight and name in target:
                weight_of[target[name]] = weight_of.get(target[name], 0.0) + weight
        self._count(len(values) * len(weight_of), f"{at}.targets")
        for number, weight in weight_of.items():
            delta = vectors(self.asset, number)
            if len(delta) != len(values):
                raise MeshError(self.asset.path, f"{at}.targets: {name}", f"{len(values)} rows", len(delta))
            values = values + weight * delta.astype(np.float64)
        return values

    def _skinned(self, skin: int, drawn: DrawnPrimitive, stored: Posed, at: str) -> Posed:
        """A primitive in the world, as the joints of a skin move it. Args: at: its path, for messages."""
        matrices = self._joints(skin)
        joints, weights = self._influences(drawn, len(stored.vertices), f"{at}.")
        if joints.max() >= len(matrices):
            expected = f"numbers below {len(matrices)}, of joints of skins[{skin}]"
            raise MeshError(self.asset.path, f"{at}.JOINTS", expected, joints.max())
        if len(without := np.flatnonzero(~weights.any(axis=1))):
            got = f"none at vertex {without[0]}"
            raise MeshError(self.asset.path, f"{at}.WEIGHTS", "a weight above 0 at every vertex", got)
        vertices = np.empty(stored.vertices.shape)
        normals = None if stored.normals is None else np.empty(vertices.shape)
        turned = 0
        for start in range(0, len(vertices), _BLOCK):
            block = slice(start, start + _BLOCK)
            blended = _blended(matrices, joints[block], weights[block])
            vertices[block] = _times(blended, stored.vertices[block]) + blended[:, :, 3]
            cofactor = cofactors(blended[:, :, :3])
            sign = np.where((blended[:, 0, :3] * cofactor[:, 0]).sum(axis=1) < 0, -1, 1)
            turned += int(sign.sum())
            if normals is not None and stored.normals is not None:
                normals[block] = _times(cofactor, stored.normals[block]) * sign[:, None]
        if turned >= 0:
            return Posed(vertices, normals, np.eye(4))
        normals = None if normals is None else normals * _MIRROR
        return Posed(vertices * _MIRROR, normals, np.diag([*_MIRROR, 1.0]))

    def _joints(self, number: int) -> Float64s:
        """The maps (j, 3, 4) of a skin's joints: from the space that the mesh is stored in to the world."""
        if number in self._skins:
            return self._skins[number]
        asset = self.asset
        at = f"skins[{number}]"
        skin = entry(asset.geometry.skins, number, "skins")
        wrong = next((joint for joint in skin.joints if joint not in asset.everywhere), None)
        if wrong is not None or not skin.joints:
            got = "none" if wrong is None else f"node {wrong}, which is not there or its own ancestor"
            raise MeshError(asset.path, f"{at}.joints", "nodes of a tree", got)
        world = np.array([asset.everywhere[joint] for joint in skin.joints])
        if skin.inverseBindMatrices is not None:
            stored = values(asset, skin.inverseBindMatrices, "MAT4")
            if len(stored) < len(world) or stored.dtype.kind != "f" or not np.isfinite(stored).all():
                expected = f"{len(world)} matrices of finite floats, one a joint"
                got = f"{len(stored)} of {'others' if len(stored) >= len(world) else stored.dtype}"
                raise MeshError(asset.path, f"{at}.inverseBindMatrices", expected, got)
            world = world @ stored[: len(world)].reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
        self._skins[number] = world[:, :3]
        return self._skins[number]

    def _influences(self, drawn: DrawnPrimitive, count: int, at: str) -> tuple[npt.NDArray[Any], Float64s]:
        """Joints and weights (count, 4 for each set) of a primitive's vertices; joint 0 where the weight is 0."""
        asset = self.asset
        attributes = drawn.primitive.attributes
        numbers = {name.rpartition("_")[2] for name in attributes if name.startswith(("JOINTS_", "WEIGHTS_"))}
        influences = []
        self._count(count * len(numbers), f"{at}JOINTS")
        for number in sorted(numbers) or ["0"]:
            for name in (f"JOINTS_{number}", f"WEIGHTS_{number}"):
                if name not in attributes:
                    raise MeshError(asset.path, at + name, "joints and weights of a skinned mesh", "none")
            joints = values(asset, attributes[f"JOINTS_{number}"], "VEC4")
            weights = column(asset, drawn.primitive, f"WEIGHTS_{number}", "VEC4")
            assert weights is not None
            if joints.dtype.kind != "u" or len(joints) != count:
                got = f"{len(joints)} of {joints.dtype}"
                raise MeshError(asset.path, f"{at}JOINTS_{number}", f"{count} rows of unsigned integers", got)
            if weights.min() < 0:
                raise MeshError(asset.path, f"{at}WEIGHTS_{number}", "numbers of at least 0", weights.min())
            influences.append((np.where(weights > 0, joints, joints.dtype.type(0)), weights))
        return np.hstack([joints for joints, _ in influences]), np.hstack([weights for _, weights in influences])

    def _count(self, moved: int, at: str) -> None:
        """Add to the values that are posed. Raises: MeshError: a small file whose values are used very many times."""
        self._moved += moved
        limit = max(MAX_COPIED, sum(map(len, self.asset.buffers)))
        if self._moved > limit:
            raise MeshError(self.asset.path, at, f"at most {limit:,} moves of vertices", f"{self._moved:,}")


def _blended(matrices: Float64s, joints: npt.NDArray[Any], weights: Float64s) -> Float64s:
    """Means (n, 3, 4) of matrices, to the bit the same for the same influences in any order and at any vertex."""
    order = np.argsort(joints, axis=1, kind="stable")
    joints = np.take_along_axis(joints, order, axis=1)
    weights = np.take_along_axis(weights, order, axis=1)
    blended = np.zeros((len(joints), 3, 4))
    total = np.zeros((len(joints), 1, 1))
    for joint, weight in zip(joints.T, weights.T[:, :, None, None], strict=True):
        blended += weight * matrices[joint]
        total += weight
    return np.asarray(blended / total)


def _times(matrices: Float64s, vectors: npt.NDArray[Any]) -> Float64s:
    """The linear part of matrices (n, 3, 3 or 4) times vectors (n, 3), to the bit the same for the same of both."""
    x, y, z = vectors.T[:, :, None]
    return np.asarray(matrices[:, :, 0] * x + matrices[:, :, 1] * y + matrices[:, :, 2] * z)


def in_words(asset: Gltf) -> tuple[str, ...]:
    """A line on what is posed, or none."""
    skinned = sum(drawn.skin is not None for drawn in asset.drawn)
    morphed = sum(any(drawn.weights) for drawn in asset.drawn)
    changes = ((skinned, "by the joints of skins"), (morphed, "by the weights of morph targets"))
    words = ", ".join(f"{count:,} {by}" for count, by in changes if count)
    return (f"in the pose that viewers show at rest: of {len(asset.drawn):,} primitives {words}",) if words else ()
