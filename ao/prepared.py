"""The records that both methods bake from."""

import hashlib
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.mesh.opacity import PackedOpacity
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.sampling import seed_key
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.system.threads import thread_count
from obscurance.raytrace.types import Bools, Int64s

from .declared import options_record
from .estimate.inside import inside_solids, near_solids
from .execute.kept import NOTHING_KEPT, Kept
from .execute.tracer import Progress, Tracer
from .memory import vertex_bytes
from .mu import Mu, in_render_space
from .options import Normals, Options
from .points.occluders import joined
from .points.receivers import Receivers, find_receivers
from .rays.directions import Lobe
from .rays.ray_scene import RayScene

if TYPE_CHECKING:
    from .execute.sample_means import SampleMeans
    from .points.surface_samples import SurfaceSamples


@options_record
class Inputs:
    """Arguments of `ao.bake` and `ao.bake_texture` beside their `Options`."""

    mesh: Mesh | Any
    _: KW_ONLY
    progress: Progress | None = None
    checkpoint: Kept | None = None
    high: Mesh | Any | None = None
    groups: tuple[Int64s, Int64s] | None = None
    occluders: Sequence[Mesh | Any] = ()

    @classmethod
    def of(cls, options: Options, mesh: Mesh | Any, **inputs: Any) -> Self:
        """Arguments of options that are checked already, and of inputs in place of what these have."""
        names = {field.name for field in fields(cls)}
        values = {name: value for name, value in vars(options).items() if name in names}
        return cls(mesh, **values | inputs)


@dataclass(frozen=True, eq=False, repr=False)
class PreparedMesh(Mesh):
    """A mesh with what every bake of it builds before its rays. It serves any number of bakes, also on several threads.

    Attributes:
        axes: how its vertex normals are weighted, `normals` of `ao.bake`, which bakes must be given, too.
        placement: in render space. receivers: of all vertices.
    """

    axes: Normals = field(default="file", kw_only=True)
    placement: Placement = field(init=False)
    receivers: Receivers = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "placement", Placement.of(self))
        object.__setattr__(self, "receivers", find_receivers(self, self.placement, self.axes))

    def receivers_for(self, options: Options) -> Receivers:
        """A copy of the receivers for one bake, which may change flags.

        Raises: OptionError: other normals.
        """
        if options.normals != self.axes:
            raise OptionError("normals", f'"{self.axes}", by which the mesh was prepared', repr(options.normals))
        return replace(self.receivers, flags=self.receivers.flags.copy(), tree_seconds=0.0)


def prepare(mesh: Mesh | Any, normals: Normals = "file") -> PreparedMesh:
    """A mesh that `ao.bake` and `ao.bake_texture` take without placing it or building its hierarchy again.

    Args: mesh, normals: as `ao.bake` takes them; bakes of the result must be given the same `normals`.

    Raises: OptionError, MeshError, MemoryLimitError: as `ao.bake`.
    """
    Options(normals=normals)
    mesh = mesh_of(mesh, "prepare")
    check_memory(mesh.source, vertex_bytes(len(mesh.vertices), len(mesh.faces), 1), "to prepare the mesh")
    return PreparedMesh(**{field.name: getattr(mesh, field.name) for field in fields(Mesh)}, axes=normals)


class Prepared(NamedTuple):
    """A placed mesh, its receivers and the options of its bake."""

    mesh: Mesh  # with occluders behind it
    options: Options
    mus: tuple[Mu, ...]  # in mesh units; the first is that of w
    placement: Placement
    receivers: Receivers  # of all vertices, also of occluders
    requested: Bools | None  # the vertices in `options.only` and none of occluders; None: all
    requested_receivers: Receivers  # those of these; the same object if all are
    progress: Progress | None
    checkpoint: Kept  # begun

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        options: Options,
        progress: Progress | None,
        checkpoint: Kept | None,
        occluders: Sequence[Mesh] = (),
        radius: float | None = None,
    ) -> Self:
        """Place the mesh, find its receivers and begin the checkpoint. Per cent are of `radius`, or else of its own.

        Raises: OptionError: `options.only` is not one truth value a vertex; as `find_receivers`.
        """
        count = len(mesh.vertices)
        requested = options.only
        if requested is not None and (requested.shape != (count,) or requested.dtype != np.bool_):
            raise OptionError("only", f"bool ({count},)", f"{requested.dtype} {requested.shape}")
        checkpoint = checkpoint or NOTHING_KEPT
        mus = options.mus(mesh.radius if radius is None else radius)
        mesh = joined([mesh, *occluders])
        if isinstance(mesh, PreparedMesh):
            placement = mesh.placement
            receivers = mesh.receivers_for(options)
        else:
            placement = Placement.of(mesh)
            receivers = find_receivers(mesh, placement, options.normals)
        if occluders:
            requested = np.zeros(len(receivers.of_vertex), np.bool_)
            requested[:count] = True if options.only is None else options.only
        requested_receivers = receivers if requested is None else receivers.only(requested)
        checkpoint.begin(placement, receivers, mus, options.identity, *([count] if occluders else []))
        return cls(mesh, options, mus, placement, receivers, requested, requested_receivers, progress, checkpoint)

    @property
    def mu(self) -> Mu:
        """The falloff of w, in mesh units."""
        return self.mus[0]

    @property
    def scene(self) -> RayScene:
        """The scene that rays of the bake are traced in."""
        receivers = self.receivers
        opacity = receivers.opacity
        if self.options.back_faces == "ignore":
            opacity = (opacity or PackedOpacity(np.full(len(receivers.faces), -1)))._replace(one_sided=np.int64(1))
        lobe = Lobe(self.options.cone, self.options.weight == "uniform")
        return RayScene(self.placement.vertices, receivers.faces, receivers.hierarchy, opacity, lobe)

    def tracer(self, total_points: int) -> Tracer:
        """A tracer of up to `total_points` points, for a mesh all of its points, requested or not."""
        placement = self.placement
        mu = in_render_space(self.mus, placement.scale)
        t_max = min(mu.limit, placement.diagonal)
        return Tracer(self.scene, mu, t_max, self.threads, total_points, self.progress, self.checkpoint)

    def sample_tracer(self, means: "SampleMeans", kind: str, checkpoint: Kept | None) -> Tracer:
        """A tracer of groups of samples on the mesh, and the checkpoint begun. Args: kind: of bake."""
        points = means.samples.points
        tracer = self.tracer(len(points))
        tracer.means = means
        if checkpoint:
            digest = hashlib.blake2b(points.origins.data)
            digest.update(points.normals.data)
            checkpoint.begin(self.placement, self.receivers, self.mus, kind, self.options.identity, digest.hexdigest())
            tracer.checkpoint = checkpoint
        return tracer

    def inside(self, samples: "SurfaceSamples") -> Bools:
        """The samples (p,) that are inside of solids."""
        vertex = partial(self.receivers.faces.__getitem__, (samples.face, 0))
        interior = self.options.interior
        return inside_solids(samples.points, vertex, self.placement, self.receivers, interior, self.threads)

    def near_solids(self, samples: "SurfaceSamples") -> Bools:
        """The groups of samples (k,) that solids may cut; with `interior` mark or fill they are not sought."""
        if self.options.interior != "auto":
            return np.zeros(len(samples), np.bool_)
        return near_solids(samples, self.placement, self.receivers, self.threads)

    @property
    def key(self) -> np.uint32:
        """The key of the seed, from which all keys of directions are derived."""
        return seed_key(self.options.seed)

    @property
    def threads(self) -> int:
        return thread_count(self.options.threads)
