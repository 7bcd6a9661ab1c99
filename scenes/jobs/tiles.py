"""`obscurance bake --tiles`: a mesh larger than memory."""

import re
import time
from typing import Any

from .console import compiling, progress
from .options import BAKER


def bake_tiles(options: dict[str, Any]) -> int:
    """Bake with `--tiles` AxBxC, write, and print a summary. Returns: the exit status, 0.

    Raises: InputError. OutputError: the output, or the folder beside it that holds what is on the way.
    """
    from ao.tiles.bake_tiled import bake_tiled
    from raytrace.errors import ConflictError, OptionError
    from raytrace.system.atomic import scratch_folder
    from raytrace.system.checks import check_outputs

    from ..falloffs import make_falloff, table_of
    from ..formats.stored_mesh import open_mesh
    from ..write_bake import TILED, write_tiled

    match = re.fullmatch(r"(\d{1,3})x(\d{1,3})x(\d{1,3})", options["tiles"])
    x, y, z = map(int, match.groups()) if match else (0, 0, 0)
    if 0 in (x, y, z):
        raise OptionError("tiles", "how many along x, y and z, such as 2x2x2", repr(options["tiles"]))
    endless = options["max_distance"].strip().lower() in ("inf", "+inf", "infinity")
    if endless and not options["falloff"].startswith("table:"):
        raise ConflictError("tiles", "needs", "max_distance")
    if options["normals"] == "file":
        raise ConflictError("tiles", "does not go with", ("normals", "file"))
    start, output = time.perf_counter(), options["output"]
    falloff = make_falloff(*(options[name] for name in ("falloff", "tau", "half_distance", "max_distance")))
    if output.suffix.lower() not in TILED:
        raise OptionError("output", "a name ending in " + " or ".join(TILED) + " with --tiles", output)
    check_outputs({"--output": output}, [options["mesh"], *table_of(options["falloff"])])
    mesh = open_mesh(options["mesh"])
    given = {row.name: options[row.name] for row in BAKER.values() if "tiles" in row.on}
    with scratch_folder(output) as scratch:
        with progress(options["quiet"], "rays", form=options["progress"]) as (advance,), compiling():
            baked = bake_tiled(mesh, scratch, (x, y, z), falloff, progress=advance, **given)
        write_tiled(output, baked.w, mesh)
    if not options["quiet"]:
        took = f"{baked.rays:,} rays traced in {time.perf_counter() - start:.2f} s"
        print(f"{output}: {mesh.vertex_count:,} vertices, {took}")
        print(f"{baked.tiles:,} tiles, {baked.halo:.0%} more faces than without")
    return 0
