"""`obscurance render`: from a scene file to an image file and a report. Heavy imports wait for checked options."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .console import compiling, progress, warn


def render_file(
    scene: Path,
    output: Path,
    size: tuple[int, int] | None,
    settings: Mapping[str, Any],
    *,
    up: str | None,
    baked: Path | None,
    own_occlusion: bool,
    preview: bool,
    half: bool,
    threads: int | None,
    report: Path | None,
    quiet: bool,
) -> None:
    """`obscurance render`: read a scene, render it, write the image and a report, and print a summary.

    Args: size, settings: in place of the scene's, where they are not None. The others: `obscurance render --help`.

    Raises:
        InputError, OutputError, EmbreeError: as `read_scene`, `adjusted` and `make_picture`.
    """
    from raytrace.image.write import check_image_target
    from raytrace.system.atomic import write_json
    from raytrace.system.outputs import check_ending, check_outputs
    from raytrace.system.threads import thread_count

    thread_count(threads)
    check_image_target(output, half)
    if report:
        check_ending("--report", report, ".json")
    outputs = {"--output": output, "--report": report}
    check_outputs(outputs, [scene])
    from ..description.read import read_scene
    from ..readers.stored_w import check_stored
    from .render import adjusted, make_picture, render_report

    if baked:
        check_stored(baked)
    description = adjusted(read_scene(scene, size, up), settings, preview, baked, own_occlusion)
    check_outputs(outputs, description.files)
    warnings = warn((item.shape.mesh for item in description.scene.objects), description.notes)
    with compiling("tile"), progress(quiet, "rays", "tiles") as (baking, rendering):
        picture = make_picture(scene, description, output, half, threads, baking, rendering)
    if report:
        write_json(report, render_report(scene, description.settings, picture, thread_count(threads), warnings))
    if not quiet:
        print(picture.summary(output, description.settings))
