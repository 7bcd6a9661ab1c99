"""`obscurance bake --tiles`: a mesh larger than memory."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .console import KERNELS_OF_BAKE, compiling, progress

_KEPT = (
    *("mesh", "output", "falloff", "tau", "half_distance", "max_distance", "samples", "seed", "threads", "normals"),
    *("traversal", "progress", "quiet"),
)
_NEEDED = {
    "reconstruct": (False, "--no-reconstruct with --tiles: neighbours all over the mesh have a say"),
    "hidden": ("ignore", "ignore with --tiles: closed parts may reach through all of them"),
}
_USUAL = {"method": "vertex"}


@dataclass(frozen=True, kw_only=True)
class TilesCommand:
    """The command with its options; `obscurance bake --help` explains each."""

    mesh: Path
    output: Path
    falloff: str
    tau: float | None
    half_distance: str | None
    max_distance: str
    samples: int | None
    seed: int
    threads: int | None
    normals: Any
    traversal: Any
    progress: Any
    quiet: bool
    grid: tuple[int, int, int]

    def run(self) -> None:
        """Bake, write, and print a summary.

        Raises:
            InputError: an option or the mesh.
            OutputError: the output, or the folder beside it that holds what is on the way.
        """
        from ao.tiles.baking import bake_tiled
        from raytrace.errors import OptionError
        from raytrace.system.atomic import scratch_folder
        from raytrace.system.outputs import check_outputs

        from ..falloffs import make_falloff, table_of
        from ..tiles.stored import open_mesh
        from ..tiles.write import ENDINGS, write_tiled

        start = time.perf_counter()
        falloff = make_falloff(self.falloff, self.tau, self.half_distance, self.max_distance)
        if self.output.suffix.lower() not in ENDINGS:
            raise OptionError("output", "a name ending in " + " or ".join(ENDINGS) + " with --tiles", self.output)
        check_outputs({"--output": self.output}, [self.mesh, *table_of(self.falloff)])
        mesh = open_mesh(self.mesh)
        with scratch_folder(self.output) as scratch:
            with progress(self.quiet, "rays", form=self.progress) as (advance,), compiling(KERNELS_OF_BAKE):
                baked = bake_tiled(
                    mesh, scratch, self.grid, falloff, self.samples, self.seed, self.threads, self.normals,
                    self.traversal, advance,
                )  # fmt: skip
            write_tiled(self.output, baked.w, mesh)
        if not self.quiet:
            took = f"{baked.rays:,} rays traced in {time.perf_counter() - start:.2f} s"
            print(f"{self.output}: {mesh.vertex_count:,} vertices, {took}")
            print(f"{baked.tiles:,} tiles, {baked.halo:.0%} more faces than without")


def tiles_command(text: str, options: dict[str, Any]) -> TilesCommand:
    """The command for `--tiles` AxBxC.

    Raises: OptionError: it is not three numbers, nothing limits the distance, or an option does not go with it.
    """
    from raytrace.errors import OptionError

    found = re.fullmatch(r"(\d{1,3})x(\d{1,3})x(\d{1,3})", text)
    grid = tuple(map(int, found.groups())) if found else ()
    if len(grid) != 3 or 0 in grid:
        raise OptionError("tiles", "how many along x, y and z, such as 2x2x2", repr(text))
    endless = options["max_distance"].strip().lower() in ("inf", "+inf", "infinity")
    if endless and not options["falloff"].startswith("table:"):
        raise OptionError(
            "max_distance", "a limit with --tiles: else rays of every tile may meet the whole mesh", "inf"
        )
    for name, (needed, expected) in _NEEDED.items():
        if options[name] != needed:
            raise OptionError(name, expected, f"--{name}" if options[name] is True else options[name])
    for name, value in options.items():
        if name not in (*_KEPT, *_NEEDED, "alpha") and value and value != _USUAL.get(name):
            raise OptionError(name, "no such option with --tiles", value)
    if options["normals"] == "file":
        raise OptionError("normals", "angle, area or equal with --tiles", "file")
    return TilesCommand(**{name: options[name] for name in _KEPT}, grid=grid)
