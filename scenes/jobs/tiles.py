"""`obscurance bake --tiles`: a mesh larger than memory."""

import re
import time
from typing import Any

from .console import compiling, progress
from .options import Record


class TilesCommand(Record):
    """The command with its options as attributes. Attributes: grid: how many tiles along x, y and z."""

    grid: tuple[int, int, int]

    def run(self) -> int:
        """Bake, write, and print a summary. Returns: the exit status, 0.

        Raises:
            InputError: an option or the mesh.
            OutputError: the output, or the folder beside it that holds what is on the way.
        """
        from ao.tiles.bake_tiled import bake_tiled
        from raytrace.errors import OptionError
        from raytrace.system.atomic import scratch_folder
        from raytrace.system.outputs import check_outputs

        from ..falloffs import make_falloff, table_of
        from ..formats.stored_mesh import open_mesh
        from ..write_bake import TILED, write_tiled

        start = time.perf_counter()
        falloff = make_falloff(self.falloff, self.tau, self.half_distance, self.max_distance)
        if self.output.suffix.lower() not in TILED:
            raise OptionError("output", "a name ending in " + " or ".join(TILED) + " with --tiles", self.output)
        check_outputs({"--output": self.output}, [self.mesh, *table_of(self.falloff)])
        mesh = open_mesh(self.mesh)
        with scratch_folder(self.output) as scratch:
            with progress(self.quiet, "rays", form=self.progress) as (advance,), compiling():
                baked = bake_tiled(
                    mesh, scratch, self.grid, falloff, self.samples, self.seed, self.threads, self.normals,
                    self.traversal, advance,
                )  # fmt: skip
            write_tiled(self.output, baked.w, mesh)
        if not self.quiet:
            took = f"{baked.rays:,} rays traced in {time.perf_counter() - start:.2f} s"
            print(f"{self.output}: {mesh.vertex_count:,} vertices, {took}")
            print(f"{baked.tiles:,} tiles, {baked.halo:.0%} more faces than without")
        return 0


def tiles_command(options: dict[str, Any]) -> TilesCommand:
    """The command for `--tiles` AxBxC.

    Raises: OptionError: it is not three numbers, nothing limits the distance, or the file's normals.
    """
    from raytrace.errors import ConflictError, OptionError

    match = re.fullmatch(r"(\d{1,3})x(\d{1,3})x(\d{1,3})", options["tiles"])
    grid = tuple(map(int, match.groups())) if match else ()
    if len(grid) != 3 or 0 in grid:
        raise OptionError("tiles", "how many along x, y and z, such as 2x2x2", repr(options["tiles"]))
    endless = options["max_distance"].strip().lower() in ("inf", "+inf", "infinity")
    if endless and not options["falloff"].startswith("table:"):
        raise ConflictError("tiles", "needs", "max_distance")
    if options["normals"] == "file":
        raise ConflictError("tiles", "does not go with", ("normals", "file"))
    return TilesCommand(options, grid=grid)
