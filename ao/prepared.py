"""The record that both methods bake from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytrace.errors import OptionError
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.placement import Placement
from raytrace.sampling.hash import seed_key
from raytrace.system.threads import thread_count

from .gather.receivers import Receivers, find_receivers
from .mu import Mu
from .options import Options
from .trace.checkpoint import Checkpoint
from .trace.ray_scene import RayScene
from .trace.tracer import Progress


@dataclass(frozen=True, eq=False)
class Prepared:
    """A placed mesh, its receivers and the options of its bake.

    Attributes:
        mesh: what is baked. options: checked. mu: the falloff, in mesh units. placement: of the mesh in render space.
        receivers: of all vertices. wanted: of those in `options.only`; the same object if that is None.
        progress: called with (rays traced, rays in all), or None. checkpoint: begun, or None.
    """

    mesh: Mesh
    options: Options
    mu: Mu
    placement: Placement
    receivers: Receivers
    wanted: Receivers
    progress: Progress | None
    checkpoint: Checkpoint | None

    @classmethod
    def of(
        cls, mesh: Mesh, mu: Mu, options: Options, progress: Progress | None, checkpoint: Checkpoint | None
    ) -> Prepared:
        """Place the mesh, find its receivers, build Embree's scene and begin the checkpoint.

        Raises: as `find_receivers`, `Receivers.only` and `Checkpoint.begin`.
        """
        if checkpoint and checkpoint.partial and options.tolerance is not None:
            raise OptionError("tolerance", "a number of samples: parts cannot know what others found", "a tolerance")
        placement, only = Placement.of(mesh), options.only
        receivers = find_receivers(mesh, placement, options.normals)
        wanted = receivers if only is None else receivers.only(only)
        if checkpoint:
            chosen = None if only is None else np.packbits(only).tobytes()
            kind = options.method, options.traversal, options.rays, options.tolerance, options.reconstruct
            checkpoint.begin(placement, receivers, mu, chosen, *kind, options.seed, options.normals)
        return cls(mesh, options, mu, placement, receivers, wanted, progress, checkpoint)

    @property
    def scene(self) -> RayScene:
        """What rays are traced in."""
        receivers = self.receivers
        return RayScene(self.placement.vertices, receivers.faces, receivers.tree, receivers.embree, receivers.opacity)

    @property
    def key(self) -> np.uint32:
        """The key of the seed, from which all keys of directions are derived."""
        return seed_key(self.options.seed)

    @property
    def threads(self) -> int:
        return thread_count(self.options.threads)
