"""Warnings of what float32 cannot hold: none missing, none false."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from meshes import grid

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.warnings import precision_warnings
from obscurance.scenes.geometry.polyhedra import RawMesh, icosphere, join
from obscurance.scenes.validation.table import configurations

from .line import Line
from .pose import Pose, poses
from .solids import closed, convex, stretched


def limits(long: bool, warnings_of: Callable[[Mesh], list[str]] = precision_warnings) -> Iterator[Line]:
    """A line for each mesh that is too fine for float32: 0 where a warning says so; and one for false alarms."""
    small: RawMesh = 1e-7 * icosphere(3)[0] + [0.4, 0.3, 1e-7], icosphere(3)[1]
    for name, part, pose in (
        ("icosphere stored 10⁵ sizes away", icosphere(4), Pose(1.0, 1e5, 1, True)),
        ("ellipsoid 1000:1:1 stored 1,000 sizes away", convex()["ellipsoid 1000:1:1"], Pose(1.0, 1e3, 1, True)),
        ("slivers 10⁶:1", stretched(grid(60), (1, 1e-6, 1)), Pose(turn=1)),
        ("a sphere of 10⁻⁷ on a floor of 1", join([grid(40), small]), Pose(turn=1)),
        ("icosphere 10¹⁴ sizes away", icosphere(4), Pose(1.0, 1e14, 1)),
    ):
        silent = not warnings_of(pose.mesh(part))
        yield Line(name, str(pose), "limit not reported", int(silent), 0)

    meshes = [line.mesh for line in configurations()]
    meshes += [pose.mesh(part) for pose in poses(long) for part in closed().values()]
    alarms = sum(bool(warnings_of(mesh)) for mesh in meshes)
    yield Line("closed forms and closed meshes", f"{len(meshes)} meshes", "false alarms", alarms, 0)
