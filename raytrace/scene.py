"""Scenes: shapes with their materials, objects that place them, and lights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .brdf.material import ALPHA, Brushed, Material
from .errors import OptionError, check_type, numbers
from .image.texture import Texture
from .kernel.arrays import product
from .lights.sources import BaseLight
from .mesh.corners import split_hard_edges
from .mesh.mesh import Mesh, mesh_of
from .mesh.opacity import AlphaSurface, Opacity
from .types import Float64s, Int64s


def _freeze(owner: object, name: str, array: Float64s) -> None:
    """Make an attribute a copy that nobody can change, as what is made from a scene is kept with it."""
    copy = np.array(array)
    copy.flags.writeable = False
    object.__setattr__(owner, name, copy)


def _freeze_rows(owner: object, name: str, source: str, *shape: int) -> None:
    """Freeze numbers of `shape`, a row for each vertex, unless they are None. Raises: OptionError."""
    if getattr(owner, name) is not None:
        of_what = "(n,)" if len(shape) == 1 else f"(n, {shape[1]})"
        values = numbers(getattr(owner, name), source, name, f"an array of numbers {of_what}")
        if values.shape != shape:
            raise OptionError(name, f"shape {shape}", values.shape, source)
        _freeze(owner, name, values)


@dataclass(frozen=True, eq=False)
class Occlusion:
    """Obscurance w(p) over a shape as a texture, as glTF has it: 1 + strength (R − 1).

    Attributes:
        uv: float64 (n, 2) texture coordinates of the shape's vertices, v upwards.
        texture: its first channel R is looked up, as it is if `texture.srgb` is False.
        strength: in [0, 1].
    """

    uv: Float64s
    texture: Texture
    strength: float = 1.0

    def __post_init__(self) -> None:
        values = numbers(self.uv, "occlusion", "uv", "an array of numbers (n, 2)")
        if values.ndim != 2 or values.shape[1] != 2:
            raise OptionError("uv", "shape (n, 2)", values.shape, "occlusion")
        _freeze(self, "uv", values)
        if not 0.0 <= self.strength <= 1.0:
            raise OptionError("strength", "a number in [0, 1]", self.strength, "occlusion")


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh and its surface; many objects may share one.

    Attributes:
        mesh: in the shape's own frame, in any form that `ao.bake` takes; its `normals`, where given, are used for
            smooth shading.
        material: what it is made of.
        uv: float64 (n, 2) texture coordinates, v upwards, or None.
        texture: albedo, multiplied into the material's diffuse and ambient reflectance per channel; needs `uv`.
        occlusion: multiplied into `Object.w`.
        grain: direction that the surface is brushed along, in texture space as KHR_materials_anisotropy has it: red and
            green of [0, 1] are −1 to 1 along u and along v. As it is if `grain.srgb` is False. Needs `uv`, and a
            material with a grain, but without one of its own.
        colours: float64 (n, 3) of the vertices, linear RGB in [0, 1], or None; multiplied as `texture` is.
    """

    mesh: Mesh
    material: Material
    uv: Float64s | None = None
    texture: Texture | None = None
    occlusion: Occlusion | None = None
    grain: Texture | None = None
    colours: Float64s | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "mesh", mesh_of(self.mesh, "shape"))
        expected = 'a material, such as raytrace.Lambert(albedo=0.5) or material_from_dict({"preset": "gold"})'
        check_type(self.material, Material, "shape", "material", expected)
        if self.grain is not None and (not isinstance(self.material, Brushed) or self.material.grain is not None):
            expected = "an anisotropic material without a grain of its own"
            got = type(self.material).__name__ + (" with a grain" if isinstance(self.material, Brushed) else "")
            raise OptionError("grain", expected, got, self.mesh.source)
        if (self.texture is not None or self.grain is not None) and self.uv is None:
            raise OptionError("uv", "texture coordinates for a textured shape", "none", self.mesh.source)
        _freeze_rows(self, "uv", self.mesh.source, len(self.mesh.vertices), 2)
        if self.colours is not None:
            shape = self.mesh.vertices.shape
            values = numbers(self.colours, self.mesh.source, "colours", "an array of numbers (n, 3)")
            if values.shape != shape or not ((values >= 0) & (values <= 1)).all():
                raise OptionError("colours", f"numbers from 0 to 1, shape {shape}", values.shape, self.mesh.source)
            _freeze(self, "colours", values)
        if self.occlusion is not None:
            check_type(self.occlusion, Occlusion, self.mesh.source, "occlusion", "a raytrace.Occlusion(uv, texture)")
            if len(self.occlusion.uv) != len(self.mesh.vertices):
                expected = f"texture coordinates of {len(self.mesh.vertices)} vertices"
                raise OptionError("occlusion", expected, len(self.occlusion.uv), self.mesh.source)

    @cached_property
    def opacity(self) -> Opacity | None:
        """Alpha of the faces, times the opacity of a transparent material where there is no cutoff."""
        opacity, alpha = self.mesh.opacity, float(self.material.pack().row[ALPHA])
        if alpha == 1:
            return opacity
        if opacity is None:
            return Opacity.uniform(AlphaSurface(alpha), self.mesh.faces)
        blended = {
            surface: replace(surface, factor=alpha * surface.factor)
            for surface in opacity.surfaces
            if surface.cutoff is None
        }
        surfaces = (*(blended.get(surface, surface) for surface in opacity.surfaces), AlphaSurface(alpha))
        return replace(opacity, of=np.where(opacity.of < 0, len(opacity.surfaces), opacity.of), surfaces=surfaces)

    @cached_property
    def split(self) -> tuple[Shape, Int64s] | None:
        """The shape with a vertex for each side of hard edges (`split_hard_edges`), and which of its own each is, (k,).

        None without hard edges.
        """
        split = split_hard_edges(self.mesh)
        if split is None:
            return None
        uv, colours = (None if values is None else values[split.vertices] for values in (self.uv, self.colours))
        occlusion = self.occlusion and replace(self.occlusion, uv=self.occlusion.uv[split.vertices])
        return replace(self, mesh=split.mesh, uv=uv, colours=colours, occlusion=occlusion), split.vertices

    def __repr__(self) -> str:
        texture = "" if self.texture is None else f", {self.texture.path.name}"
        return f"<Shape {self.mesh!r}, {self.material!r}{texture}>"


@dataclass(frozen=True, eq=False)
class Object:
    """A shape in its place.

    Attributes:
        shape: shared shapes become Embree instances.
        transform: float64 (4, 4), affine, columns; the shape's frame to the world.
        name: for messages and reports.
        w: float64 (n,), obscurance at the shape's vertices where this object stands, or None: open everywhere.
        bent_normals: float64 (n, 3), mean directions of what is open there, in the world; zero: the normal. Light from
            a sky or an image is looked up along them.
    """

    shape: Shape
    transform: Float64s = field(default_factory=lambda: np.eye(4))
    name: str = "object"
    w: Float64s | None = None
    bent_normals: Float64s | None = None

    def __repr__(self) -> str:
        return f"<Object {self.name!r}: {self.shape!r}{'' if self.w is None else ', with w'}>"

    def __post_init__(self) -> None:
        check_type(self.shape, Shape, self.name, "shape", "a raytrace.Shape(mesh, material)")
        matrix = numbers(self.transform, self.name, "transform", "a (4, 4) matrix")
        affine = matrix.shape == (4, 4) and np.isfinite(matrix).all() and (matrix[3] == [0, 0, 0, 1]).all()
        if not affine or np.linalg.det(matrix[:3, :3]) == 0:
            raise OptionError("transform", "a finite, invertible affine (4, 4) matrix", matrix.tolist(), self.name)
        _freeze(self, "transform", matrix)
        _freeze_rows(self, "w", self.name, len(self.shape.mesh.vertices))
        _freeze_rows(self, "bent_normals", self.name, len(self.shape.mesh.vertices), 3)


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects and lights.

    Attributes:
        objects: at least one.
        lights: point, directional, spot and ambient lights, skies, and an environment image at most.
        background: linear RGB where a ray meets nothing.
    """

    objects: tuple[Object, ...]
    lights: tuple[BaseLight, ...] = ()
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, kind, expected in (
            ("objects", Object, "raytrace.Objects in a tuple or list"),
            ("lights", BaseLight, "lights, such as raytrace.PointLight, in a tuple or list"),
        ):
            values = getattr(self, name)
            check_type(values, Sequence, "scene", name, expected)
            for number, value in enumerate(values):
                check_type(value, kind, "scene", f"{name}[{number}]", expected)
            object.__setattr__(self, name, tuple(values))
        if not self.objects:
            raise OptionError("objects", "at least one", "none", "scene")
        background = numbers(self.background, "scene", "background", "three numbers")
        if background.shape != (3,):
            raise OptionError("background", "three numbers", repr(self.background), "scene")
        object.__setattr__(self, "background", tuple(background.tolist()))

    def flattened(self) -> Mesh:
        """All objects as one mesh in world space, in order: what a bake of the whole scene takes."""
        vertices = []
        faces = []
        normals = []
        opacities = []
        start = 0
        for item in self.objects:
            mesh, linear = item.shape.mesh, item.transform[:3, :3]
            vertices.append(product(mesh.vertices, linear.T) + item.transform[:3, 3])
            mirrored = np.linalg.det(linear) < 0
            faces.append((mesh.faces[:, ::-1] if mirrored else mesh.faces) + start)
            own = np.full(mesh.vertices.shape, np.nan) if mesh.normals is None else mesh.normals
            normals.append(product(own, np.linalg.inv(linear)))
            opacity = item.shape.opacity
            opacities.append(opacity.reversed() if opacity and mirrored else opacity)
            start += len(mesh.vertices)
        opacity = Opacity.joined(opacities, [len(triangles) for triangles in faces])
        own_normals = None if all(item.shape.mesh.normals is None for item in self.objects) else np.concatenate(normals)
        return Mesh(np.concatenate(vertices), np.concatenate(faces), own_normals, source="scene", opacity=opacity)

    @property
    def shaded(self) -> Scene:
        """The scene with each side of hard edges a vertex of its own, with the w of both; itself without any."""
        return self._split or self

    @cached_property
    def _split(self) -> Scene | None:
        """`shaded`, if it is another scene: one that referred to itself would stay in memory."""
        if not any(item.shape.split for item in self.objects):
            return None
        objects = []
        for item in self.objects:
            if item.shape.split:
                shape, of = item.shape.split
                w, bent = (None if values is None else values[of] for values in (item.w, item.bent_normals))
                item = replace(item, shape=shape, w=w, bent_normals=bent)
            objects.append(item)
        return replace(self, objects=tuple(objects))

    def without_occlusion(self) -> Scene:
        """The same scene without occlusion textures; objects that shared a shape share one still."""
        return self._with_shapes(lambda shape: replace(shape, occlusion=None) if shape.occlusion else shape)

    def without_alpha(self) -> Scene:
        """The same scene with opaque faces; transparent materials stay as they are."""
        return self._with_shapes(lambda shape: replace(shape, mesh=replace(shape.mesh, opacity=None)))

    def _with_shapes(self, change: Callable[[Shape], Shape]) -> Scene:
        """The scene with every shape changed; objects that shared a shape share the changed one."""
        changed = {id(item.shape): change(item.shape) for item in self.objects}
        return replace(self, objects=tuple(replace(item, shape=changed[id(item.shape)]) for item in self.objects))

    def with_obscurance(self, w: Float64s | Sequence[float], bent_normals: Float64s | None = None) -> Scene:
        """The same scene with w (n,) and bent normals (n, 3) of the vertices of `flattened()`."""
        ends = np.cumsum([len(item.shape.mesh.vertices) for item in self.objects])[:-1]
        values = np.split(np.asarray(w, np.float64), ends)
        bent = [None] * len(values) if bent_normals is None else np.split(np.asarray(bent_normals, np.float64), ends)
        parts = zip(self.objects, values, bent, strict=True)
        return replace(self, objects=tuple(replace(item, w=w, bent_normals=b) for item, w, b in parts))
