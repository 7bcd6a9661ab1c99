"""Objects placed in render space and built into Embree: what of a scene depends on shapes and transforms alone."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from ..brdf.material import ALPHA, TWO_SIDED, pack_materials
from ..bvh.bvh16 import BVH16
from ..embree import EmbreeInstance, EmbreeScene, Triangles, TriangleScene
from ..image.texture import Texture
from ..kernel.arrays import aligned, product
from ..mesh.mesh import Mesh
from ..mesh.normals import normalize, smooth_normals
from ..mesh.opacity import Opacity, PackedOpacity
from ..mesh.placement import Placement, RenderSpace, sample, to_single
from ..ray_origins.origins import weld_points
from ..ray_origins.surface import Surface
from ..scene import Object, Shape
from ..settings import Normals
from ..shade.alpha_filter import filter_hits
from ..shade.layout import Geometry
from ..shade.shaft_culling import SLACK, cluster, merged, pack_boxes
from ..types import AnyFloats, Bools, Float32s, Float64s, Int32s, Int64s
from .polygon_outlines import Polygons, mesh_polygons

_INSTANCED = 4.0  # the ray's own way into an instance's frame is rounded too, as if coordinates were that large


@dataclass(frozen=True, eq=False)
class BuiltGeometry:
    """Objects ready for kernels; a point p of the scene stands at (p − centre) · scale."""

    arrays: Geometry
    opacity: PackedOpacity | None  # of the shapes' faces; None if all is opaque, materials included
    embree: EmbreeScene  # keeps the Embree scene and its buffers alive
    centre: Float64s
    scale: float  # a power of two
    textures: tuple[Texture, ...]  # of the shapes, numbered as in `arrays`
    normals: Normals

    @cached_property
    def vertex_origins(self) -> Float32s:
        """Origins of shadow rays from the vertices of all objects in order: float32 (n, 3), in render space.

        They are in front of all faces of the scene that meet at a vertex (`raytrace.ray_origins`). Where a surface has
        two sides there are n more, for vertices seen from behind.
        """
        vertices, faces, normals = _in_render_space(self.arrays)
        points = weld_points(vertices, faces, normals=normals)
        away = 0.0 if self.arrays.placed.all() else _INSTANCED  # all that is reckoned with grows with coordinates
        surface = Surface.of(vertices + away, points.surface.faces, points.surface.backwards)
        tree = BVH16.of(surface.vertices.astype(np.float32), surface.faces)
        sides = [points._replace(surface=surface)]
        if self.arrays.materials[:, TWO_SIDED].any():
            sides.append(sides[0].reversed())
        origins = [side.ray_origins(tree)[0][points.group] for side in sides]
        return _padded_rows([side - away for side in origins], np.float32)

    @cached_property
    def hit_filter(self) -> tuple[int, Int64s] | None:
        """`raytrace.shade.alpha_filter.filter_hits` for `new_packet`, None where all is opaque."""
        of = self.arrays
        return self.opacity and filter_hits.callback(self.opacity, of.first_face, of.materials)


_built: WeakValueDictionary[Any, BuiltGeometry] = WeakValueDictionary()


def build_geometry(objects: tuple[Object, ...], normals: Normals) -> BuiltGeometry:
    """The geometry of `objects` with such vertex normals; the same as before while that is in use somewhere.

    Raises: EmbreeError: Embree failed, out of memory for instance. InputError: an image of alpha cannot be read.
    """
    key = normals, *((item.shape, item.transform.tobytes()) for item in objects)
    geometry = _built.get(key)
    if geometry is None:
        geometry = _built[key] = _build(objects, normals)
    return geometry


class _PlacedShape(NamedTuple):
    """A shape in the frame it is traced in."""

    shape: Shape
    vertices: Float32s
    normals: Float32s
    scene: TriangleScene | None  # of a shape that several objects use
    from_shape: Float64s  # (4, 4)


def _build(objects: tuple[Object, ...], weighting: Normals) -> BuiltGeometry:
    """The geometry of objects with such vertex normals. Raises: as `build_geometry`."""
    space, reach = _render_space(objects)
    placed_shapes, rank = _place_shapes(objects, space, weighting)
    shapes = [placed.shape for placed in placed_shapes]
    meshes = [shape.mesh for shape in shapes]

    # objects: where they are, what Embree traces, and their materials
    instanced = np.array([placed.scene is not None for placed in placed_shapes])[rank]
    transforms = np.array([item.transform for item in objects])
    matrices = _to_render(transforms, space, placed_shapes, rank, instanced)
    embree, boxes = _build_embree(placed_shapes, rank, matrices)
    kinds, material_rows = pack_materials([shape.material for shape in shapes])

    # shapes: their vertices and faces one after the other, then polygons
    vertex_starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    face_starts = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    polygons = _polygons(placed_shapes)
    textures = shape_textures(shapes)
    opacity = _opacity(shapes)
    arrays = Geometry(
        handle=embree.handle,
        farthest=8.0 * max(1.0, space.scale * reach),
        vertices=_padded_rows([*(placed.vertices for placed in placed_shapes), polygons.centres], np.float32),
        normals=_padded_rows([*(placed.normals for placed in placed_shapes), polygons.normals], np.float32),
        faces=_padded_rows([mesh.faces + start for mesh, start in zip(meshes, vertex_starts, strict=False)], np.int32),
        uv=joined(meshes, [shape.uv for shape in shapes], 2, needed=True),
        occlusion_uv=joined(meshes, [shape.occlusion.uv if shape.occlusion else None for shape in shapes], 2),
        colours=joined(meshes, [shape.colours for shape in shapes], 3, fill=1.0),
        polygons=polygons.of,
        edges=polygons.edges,
        first_edge=np.cumsum(np.append(0, polygons.counts)).astype(np.int32),
        first_vertex=vertex_starts[rank],
        first_face=face_starts[rank],
        first_w=np.cumsum([0, *(len(item.shape.mesh.vertices) for item in objects)]),
        to_render=np.ascontiguousarray(matrices[:, :3]),
        normal_to_render=np.ascontiguousarray(np.linalg.inv(matrices[:, :3, :3]).transpose(0, 2, 1)),
        mirrored=np.sign(np.linalg.det(transforms[:, :3, :3])),
        placed=~instanced,
        authored=np.array([weighting == "file" and item.shape.mesh.normals is not None for item in objects]),
        magnitude=np.where(instanced, _INSTANCED, 0.0),
        **_texture_rows(objects, textures),
        kinds=kinds[rank],
        materials=material_rows[rank],
        boxes=pack_boxes(merged(boxes)),
        layered=opacity is not None,
    )
    return BuiltGeometry(arrays, opacity, embree, space.centre, space.scale, textures, weighting)


def _place_shapes(
    objects: tuple[Object, ...], space: RenderSpace, weighting: Normals
) -> tuple[list[_PlacedShape], Int64s]:
    """The shapes of objects as they are traced, and of each object (o,) the row of its shape.

    Shapes of one object alone are in render space, shared ones in a frame of their own.
    """
    uses: dict[int, list[Object]] = {}
    for item in objects:
        uses.setdefault(id(item.shape), []).append(item)
    to_render = _scaling(space.centre, space.scale)
    shapes = [
        _place_shape(item.shape, None if others else to_render @ item.transform, weighting)
        for item, *others in uses.values()
    ]
    row_of = {key: row for row, key in enumerate(uses)}
    return shapes, np.array([row_of[id(item.shape)] for item in objects])


def _to_render(
    transforms: Float64s, space: RenderSpace, shapes: list[_PlacedShape], rank: Int64s, instanced: Bools
) -> Float64s:
    """Matrices (o, 4, 4) from objects' shapes, as they are traced, to render space. Args: rank: rows in `shapes`."""
    from_shape = np.array([placed.from_shape if placed.scene else np.eye(4) for placed in shapes])
    matrices = _scaling(space.centre, space.scale) @ transforms @ np.linalg.inv(from_shape)[rank]
    return np.where(instanced[:, None, None], matrices, np.eye(4))


def _build_embree(shapes: list[_PlacedShape], rank: Int64s, matrices: Float64s) -> tuple[EmbreeScene, Float64s]:
    """The Embree scene of objects, `rank` (o,) their rows in `shapes`, and boxes (n, 2, 3) around what they hold."""
    geometries: list[Triangles | EmbreeInstance] = []
    corners = np.array([_corners(placed.vertices) for placed in shapes])[rank]
    corners = corners @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
    around = np.stack([corners.min(axis=1) - 4 * SLACK, corners.max(axis=1) + 4 * SLACK], axis=1)
    boxes = []
    for placed, matrix, box in zip((shapes[row] for row in rank), matrices.astype(np.float32), around, strict=True):
        if placed.scene:
            geometries.append(EmbreeInstance(placed.scene, matrix[:3]))
            boxes.append(box[None])
        else:
            geometries.append(Triangles(placed.vertices, placed.shape.mesh.faces))
            boxes.append(cluster(placed.vertices, placed.shape.mesh.faces, len(rank)))
    return EmbreeScene(geometries), np.concatenate(boxes)


def _polygons(shapes: list[_PlacedShape]) -> Polygons:
    """The polygons of all shapes' meshes, numbered behind their vertices."""
    none = mesh_polygons(np.empty((0, 3), np.float32), np.empty((0, 3), np.int32), None)
    meshes = [placed.shape.mesh for placed in shapes]
    if all(mesh.polygons is None for mesh in meshes):
        return none
    vertex, number = 0, sum(len(mesh.vertices) for mesh in meshes)
    polygons = []
    for mesh, placed in zip(meshes, shapes, strict=True):
        outlines = mesh_polygons(placed.vertices, mesh.faces, mesh.polygons)
        mirrored = placed.scene is None and np.linalg.slogdet(placed.from_shape[:3, :3])[0] < 0
        outlines.of[outlines.of >= 0] += number
        outlines.edges[:] += vertex
        polygons.append(outlines._replace(normals=-outlines.normals) if mirrored else outlines)
        vertex = vertex + len(mesh.vertices)
        number = number + len(outlines.counts)
    whole = Polygons(*map(np.concatenate, zip(*polygons, strict=True)))
    return whole if len(whole.counts) else none


def shape_textures(shapes: Iterable[Shape]) -> tuple[Texture, ...]:
    """The textures that shapes are drawn with: colours, occlusion and grain, each once."""
    kinds = ((shape.texture, shape.occlusion and shape.occlusion.texture, shape.grain) for shape in shapes)
    return tuple(dict.fromkeys(texture for textures in kinds for texture in textures if texture))


def _texture_rows(objects: tuple[Object, ...], textures: tuple[Texture, ...]) -> dict[str, Any]:
    """The rows of objects' textures among `textures`, −1 for none, and the strength of occlusion: fields of
    `Geometry`."""
    row_of = {texture: row for row, texture in enumerate(textures)} | {None: -1}
    occlusions = [item.shape.occlusion for item in objects]
    return {
        "texture": np.array([row_of[item.shape.texture] for item in objects]),
        "grain": np.array([row_of[item.shape.grain] for item in objects]),
        "occlusion": np.array([row_of[occlusion.texture] if occlusion else -1 for occlusion in occlusions]),
        "strength": np.array([occlusion.strength if occlusion else 0.0 for occlusion in occlusions]),
    }


def joined(
    meshes: Iterable[Mesh], values_of: list[Float64s | None], columns: int, fill: float = 0.0, needed: bool = False
) -> Float32s:
    """Values of the vertices of all meshes one after another, `fill` where a mesh has None.

    Without `needed` there are no rows if no mesh has values.
    """
    if not needed and all(values is None for values in values_of):
        return aligned((0, columns), np.float32)
    parts = [
        np.full((len(mesh.vertices), columns), fill) if g is None else g
        for mesh, g in zip(meshes, values_of, strict=True)
    ]
    return _padded_rows(parts, np.float32)


def _opacity(shapes: list[Shape]) -> PackedOpacity | None:
    """The opacity of the faces of all shapes; None if these, and their materials, are opaque."""
    counts = [len(shape.mesh.faces) for shape in shapes]
    joined = Opacity.joined([shape.mesh.opacity for shape in shapes], counts)
    packed = joined.packed() if joined else None
    if packed is None and any(shape.material.pack().row[ALPHA] < 1 for shape in shapes):
        return PackedOpacity(np.full(sum(counts), -1))
    return packed


def _render_space(objects: tuple[Object, ...]) -> tuple[RenderSpace, float]:
    """Render space for the bounding boxes of all objects, and the largest distance from its centre."""

    def place(item: Object, points: Float64s) -> Float64s:
        return points @ item.transform[:3, :3].T + item.transform[:3, 3]

    shapes = {id(item.shape): item.shape for item in objects}
    boxes = {key: _corners(np.array(shape.mesh.bounds)) for key, shape in shapes.items()}
    corners = [place(item, boxes[id(item.shape)]) for item in objects]
    low = np.min(corners, axis=(0, 1))
    high = np.max(corners, axis=(0, 1))
    sampled = sample(sum(len(item.shape.mesh.used) for item in objects))  # the same fraction of each object
    space = RenderSpace.around(
        low, high, np.concatenate([place(item, item.shape.mesh.used[sampled]) for item in objects])
    )
    return space, float(np.maximum(high - space.centre, space.centre - low).max())


def _corners(points: AnyFloats) -> Float64s:
    """The eight corners (8, 3) of the bounding box of points."""
    ends = zip(points.min(axis=0), points.max(axis=0), strict=True)
    return np.array(np.meshgrid(*ends), np.float64).reshape(3, -1).T


def _padded_rows(parts: list[npt.NDArray[Any]], dtype: type[np.generic]) -> npt.NDArray[Any]:
    """The rows of all `parts` in one array, padded as `raytrace.kernel.simd.gather3` wants it."""
    whole = aligned((sum(map(len, parts)), parts[0].shape[1]), dtype)
    np.concatenate(parts, out=whole, casting="same_kind")
    return whole


def _place_shape(shape: Shape, matrix: Float64s | None, weighting: Normals) -> _PlacedShape:
    """A shape in render space, where its `matrix` puts it; or if it has none, in a frame of its own for instances."""
    mesh, normals = shape.mesh, _vertex_normals(shape.mesh, weighting)
    if matrix is not None:
        vertices = to_single(product(mesh.vertices, matrix[:3, :3].T) + matrix[:3, 3])
        normals = normalize(product(normals, np.linalg.inv(matrix[:3, :3])))
        return _PlacedShape(shape, vertices, normals.astype(np.float32), None, matrix)
    placement = Placement.of(mesh)
    scene = TriangleScene(placement.vertices, mesh.faces)
    matrix = _scaling(placement.centre, placement.scale)
    return _PlacedShape(shape, placement.vertices, normals.astype(np.float32), scene, matrix)


def _scaling(centre: Float64s, scale: float) -> Float64s:
    """The matrix (4, 4) from p to (p − centre) · scale."""
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = -scale * centre
    return matrix


def _vertex_normals(mesh: Mesh, normals: Normals) -> Float64s:
    """Unit normals (n, 3) of vertices in the mesh's own frame; zero where there is none."""
    if normals == "file" and mesh.normals is not None:
        return normalize(mesh.normals)
    return smooth_normals(Placement.of(mesh).vertices, mesh.faces, "angle" if normals == "file" else normals)


def _in_render_space(geometry: Geometry) -> tuple[Float64s, Int32s, Float64s]:
    """All objects as one mesh in render space, faces wound outwards: vertices, faces, unit vertex normals."""
    vertices = []
    faces = []
    normals = []
    begins = np.unique(geometry.first_face)
    ends = np.append(begins, len(geometry.faces))[np.searchsorted(begins, geometry.first_face) + 1]
    for item, size in enumerate(np.diff(geometry.first_w)):
        start = geometry.first_vertex[item]
        positions = geometry.vertices[start : start + size].astype(np.float64)
        normal = geometry.normals[start : start + size].astype(np.float64)
        if not geometry.placed[item]:
            positions = product(positions, geometry.to_render[item, :, :3].T) + geometry.to_render[item, :, 3]
            normal = product(normal, geometry.normal_to_render[item].T)
        corners = geometry.faces[geometry.first_face[item] : ends[item]] - start + geometry.first_w[item]
        vertices.append(positions)
        faces.append(corners[:, ::-1] if geometry.mirrored[item] < 0 else corners)
        normals.append(normal)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32), normalize(np.concatenate(normals))
