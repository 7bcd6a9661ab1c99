"""A scene as kernels read it: one Embree scene, flat arrays, everything recentred and scaled to about unit size."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from ..embree.scene import EmbreeScene, Instance, Triangles, TriangleScene
from ..kernel.arrays import aligned, product
from ..lights import layout as light_rows
from ..lights.far_lights import make_far_lights_directional
from ..lights.sources import BaseLight, pack_lights
from ..materials.materials import pack_materials
from ..mesh.mesh import Mesh
from ..mesh.normals import normalize
from ..mesh.placement import Placement
from ..scene import Object, Scene, Shape
from ..settings import Normals
from ..shade.records import Geometry, Lights
from ..shade.shaft_culling import SLACK, cluster, pack_boxes
from .vertex_origins import INSTANCED, smooth_normals, vertex_origins

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class World:
    """A scene ready for kernels.

    Attributes:
        geometry, lights: what kernels read. embree: keeps the scene and its buffers alive.
        centre, scale: a world point p stands at (p − centre) · scale here; scale is a power of two.
        textures: the scene's textures, in the order of `geometry.texture`.
        normals: of vertices, see `raytrace.settings.Settings`.
    """

    geometry: Geometry
    lights: Lights
    embree: EmbreeScene
    centre: Floats
    scale: float
    textures: tuple[Any, ...]
    normals: Normals = "file"

    @cached_property
    def vertex_origins(self) -> npt.NDArray[np.float32]:
        """`raytrace.renderer.vertex_origins.vertex_origins`, made when it is first asked for."""
        return vertex_origins(self.geometry)


class _Piece(NamedTuple):
    """A shape in the frame it is traced in."""

    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    scene: TriangleScene | None
    from_shape: Floats  # (4, 4)


def build(scene: Scene, normals: Normals = "file", keep: bool = True) -> World:
    """The Embree scene and the arrays of `scene` with such vertex normals, made when they are first asked for.

    A shape that one object uses is placed once and for all; one that several use becomes instances.

    Args: keep: as long as the scene, for the next who asks.

    Raises:
        EmbreeError: Embree failed, out of memory for instance.
    """
    world = _worlds.get(scene)
    if world is None or world.normals != normals:
        world = _build(scene, normals)
        if keep:
            _worlds[scene] = world
    return world


_worlds: WeakKeyDictionary[Scene, World] = WeakKeyDictionary()


def _build(scene: Scene, weighting: Normals) -> World:
    whole = _bounds(scene)
    placement = Placement.of(whole)
    centre, scale = whole.centre, placement.scale
    place = np.diag([scale, scale, scale, 1.0])
    place[:3, 3] = -scale * centre

    uses: dict[int, list[Object]] = {}
    for item in scene.objects:
        uses.setdefault(id(item.shape), []).append(item)
    shapes = {key: items[0].shape for key, items in uses.items()}
    order = {key: row for row, key in enumerate(shapes)}
    pieces = {
        key: _shared(shapes[key], weighting)
        if len(items) > 1
        else _single(shapes[key], place @ items[0].transform, weighting)
        for key, items in uses.items()
    }
    vertex_starts = _starts([len(shape.mesh.vertices) for shape in shapes.values()])
    face_starts = _starts([len(shape.mesh.faces) for shape in shapes.values()])
    w_starts = _starts([len(item.shape.mesh.vertices) for item in scene.objects])
    textures = tuple(dict.fromkeys(shape.texture for shape in shapes.values() if shape.texture))

    geometries: list[Triangles | Instance] = []
    boxes = []
    count = len(scene.objects)
    to_world, normal_to_world = np.empty((count, 3, 4)), np.empty((count, 3, 3))
    mirrored, magnitude = np.ones(count), np.zeros(count)
    for row, item in enumerate(scene.objects):
        piece = pieces[id(item.shape)]
        matrix = place @ item.transform @ np.linalg.inv(piece.from_shape) if piece.scene else np.eye(4)
        if piece.scene:
            geometries.append(Instance(piece.scene, matrix[:3].astype(np.float32)))
            magnitude[row] = INSTANCED
            corners = _corners(piece.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
            boxes.append(np.stack([corners.min(axis=0) - 4 * SLACK, corners.max(axis=0) + 4 * SLACK])[None])
        else:
            geometries.append(Triangles(piece.vertices, item.shape.mesh.faces))
            boxes.append(cluster(piece.vertices, item.shape.mesh.faces, count))
        to_world[row] = matrix[:3]
        normal_to_world[row] = np.linalg.inv(matrix[:3, :3]).T
        mirrored[row] = np.sign(np.linalg.det(item.transform[:3, :3]))
    embree = EmbreeScene(geometries)

    rank = [order[id(item.shape)] for item in scene.objects]
    kinds, rows = pack_materials([item.shape.material for item in scene.objects])
    uv = [np.zeros((len(s.mesh.vertices), 2)) if s.uv is None else s.uv for s in shapes.values()]
    w = [np.ones(len(item.shape.mesh.vertices)) if item.w is None else item.w for item in scene.objects]
    corner_rows = [s.mesh.faces + start for s, start in zip(shapes.values(), vertex_starts, strict=True)]
    geometry = Geometry(
        handle=embree.handle,
        vertices=_joined([piece.vertices for piece in pieces.values()], np.float32),
        normals=_joined([piece.normals for piece in pieces.values()], np.float32),
        faces=_joined(corner_rows, np.int32),
        uv=np.concatenate(uv).astype(np.float32),
        w=np.concatenate(w),
        first_vertex=vertex_starts[rank],
        first_face=face_starts[rank],
        first_w=w_starts,
        to_world=to_world,
        normal_to_world=normal_to_world,
        mirrored=mirrored,
        placed=np.array([pieces[id(item.shape)].scene is None for item in scene.objects]),
        authored=np.array([weighting == "file" and item.shape.mesh.normals is not None for item in scene.objects]),
        magnitude=magnitude,
        texture=np.array([textures.index(t) if (t := item.shape.texture) else -1 for item in scene.objects]),
        kinds=kinds,
        rows=rows,
        boxes=pack_boxes(np.concatenate(boxes)),
    )
    lights = _place_lights(scene.lights, centre, scale)
    return World(geometry, lights, embree, centre, scale, textures, weighting)


def _bounds(scene: Scene) -> Mesh:
    """The corners of all objects' bounding boxes, in the world: what the world is centred and scaled by."""
    corners = []
    for item in scene.objects:
        corners.append(_corners(item.shape.mesh.vertices) @ item.transform[:3, :3].T + item.transform[:3, 3])
    return Mesh(np.concatenate(corners), np.array([[0, 1, 2]]), source="scene")


def _corners(points: npt.NDArray[np.floating[Any]]) -> Floats:
    """The corners (8, 3) of the points' bounding box."""
    ends = zip(points.min(axis=0), points.max(axis=0), strict=True)
    return np.array(np.meshgrid(*ends), np.float64).reshape(3, -1).T


def _joined(parts: list[npt.NDArray[Any]], dtype: type[np.generic]) -> npt.NDArray[Any]:
    """The rows of all `parts`, (n, 3), as `raytrace.kernel.simd_memory.gather3` wants them."""
    joined = aligned((sum(map(len, parts)), 3), dtype)
    np.concatenate(parts, out=joined, casting="same_kind")
    return joined


def _starts(lengths: list[int]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths[:-1])]).astype(np.int64)


def _shared(shape: Shape, weighting: Normals) -> _Piece:
    mesh = shape.mesh
    placement = Placement.of(mesh)
    matrix = np.diag([placement.scale, placement.scale, placement.scale, 1.0])
    matrix[:3, 3] = -placement.scale * mesh.centre
    normals = smooth_normals(mesh, weighting).astype(np.float32)
    return _Piece(placement.vertices, normals, TriangleScene(placement.vertices, mesh.faces), matrix)


def _single(shape: Shape, matrix: Floats, weighting: Normals) -> _Piece:
    mesh, linear = shape.mesh, matrix[:3, :3]
    vertices = (product(mesh.vertices, linear.T) + matrix[:3, 3]).astype(np.float32)
    normals = normalize(product(smooth_normals(mesh, weighting), np.linalg.inv(linear))).astype(np.float32)
    return _Piece(vertices, normals, None, matrix)


def _place_lights(lights: tuple[BaseLight, ...], centre: Floats, scale: float) -> Lights:
    """Positions and attenuation in the world's own units; black lights are left out."""
    kinds, rows = pack_lights(list(lights))
    rows[:, light_rows.POSITION : light_rows.POSITION + 3] = scale * (
        rows[:, light_rows.POSITION : light_rows.POSITION + 3] - centre
    )
    radial = rows[:, light_rows.RADIAL : light_rows.RADIAL + 3]
    radial /= scale ** np.arange(3)
    largest = np.where(radial.any(axis=1), radial.max(axis=1), 1.0)[:, None]  # kept out of what float32 can hold
    radial /= largest
    rows[:, light_rows.INTENSITY : light_rows.INTENSITY + 3] /= largest
    rows[:, light_rows.INVERSE_RANGE] /= scale
    make_far_lights_directional(kinds, rows)
    bright = rows[:, light_rows.INTENSITY : light_rows.INTENSITY + 3].any(axis=1)
    return Lights(kinds[bright], rows[bright])
