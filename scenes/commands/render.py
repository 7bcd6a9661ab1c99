"""Make the picture of a scene file: bake what it needs, render it, write it, report it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ao
from ao.execute.tracer import Progress
from ao.report import SCHEMA_VERSION, calibration_facts, versions
from raytrace import Frame, Settings
from raytrace.errors import ConflictError, printable
from raytrace.image.write import check_image_target, write_frame
from raytrace.renderer.render import describe_work, render, rendering_bytes
from raytrace.system.checks import check_memory

from ..description.description import SceneDescription
from ..falloffs import Scales
from ..jobs.options import Alpha
from .picture_bake import with_obscurance

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession

PREVIEW = 4  # a preview's sides are that much shorter
PREVIEW_BAKE = 32  # and it bakes with that many rays a vertex


@dataclass(frozen=True)
class RenderedPicture:
    """A picture that was made, and its costs."""

    frame: Frame  # the layers that the file's format holds, and the renderer's counts
    bake: ao.Bake | None
    seconds: dict[str, float]  # bake, build, render, write

    def summary(self, target: Path, settings: Settings) -> str:
        """The line after a rendering: file, size, rays, times."""
        traced, skipped = sum(self.frame.rays.values()), sum(self.frame.rays_skipped.values())
        rays = f"{traced / 1e6:.1f} M rays traced and {skipped / 1e6:.1f} M skipped in {self.seconds['render']:.2f} s"
        baked = f", baked in {self.seconds['bake']:.2f} s" if self.bake else ""
        size = f"{settings.width}×{settings.height}"
        return f"{printable(str(target))}: {size}, {rays}; obscurance {settings.obscurance}{baked}"


def adjusted(
    description: SceneDescription,
    changes: Mapping[str, Any],
    preview: bool,
    baked: Path | None = None,
    own_occlusion: bool = True,
    alpha: Alpha = "auto",
    scales: Scales | None = None,
) -> SceneDescription:
    """The description with the `Settings` changed that are not None; a preview: a quarter as wide and high, few rays.

    Args:
        baked: a file with w, in place of the description's own or of a bake. scales: of its profile.
        own_occlusion: use the occlusion textures that the file has, in place of a bake.
        alpha: "ignore": faces are opaque.

    Raises: OptionError: a setting out of range, or `baked` for a picture without obscurance.
    """
    settings = replace(description.settings, **{name: value for name, value in changes.items() if value is not None})
    w_from, bake, files = description.w_from, description.bake, description.files
    if settings.obscurance == "off":
        w_from = "off"
    elif w_from == "off":
        w_from = "bake"
    if baked is not None:
        if settings.obscurance == "off":
            raise ConflictError("baked", "does not go with", ("obscurance", "off"))
        w_from, files = baked, (*files, baked)
    if preview:
        settings = _quarter(settings)
        bake = replace(bake, samples=min(bake.rays, PREVIEW_BAKE))
    scene = description.scene if own_occlusion else description.scene.without_occlusion()
    if alpha == "ignore":
        scene = scene.without_alpha()
    if scales and not isinstance(w_from, Path):
        raise ConflictError("half_distance", "needs", "baked")
    scales = scales or (None if baked else description.scales)
    return replace(description, scene=scene, settings=settings, w_from=w_from, bake=bake, files=files, scales=scales)


def _quarter(settings: Settings) -> Settings:
    width, height = max(settings.width // PREVIEW, 1), max(settings.height // PREVIEW, 1)
    crop = settings.crop
    if crop:
        x, y = min(crop[0] // PREVIEW, width - 1), min(crop[1] // PREVIEW, height - 1)
        crop = x, y, min(max(crop[2] // PREVIEW, 1), width - x), min(max(crop[3] // PREVIEW, 1), height - y)
    return replace(settings, width=width, height=height, crop=crop, samples=min(settings.samples, 4))


def make_picture(
    source: Path,
    description: SceneDescription,
    output: Path,
    half: bool = False,
    threads: int | None = None,
    baking: Progress | None = None,
    rendering: Progress | None = None,
    session: ClusterSession | None = None,
) -> RenderedPicture:
    """Make the picture of a described scene and write it.

    Args: source: the scene file, for the picture's metadata. half: 16-bit floats in EXR. baking, rendering: progress.
        session: workers who trace the rays.

    Raises:
        InputError: a texture or a baked file cannot be read; the ending of `output`, or `threads`.
        MemoryLimitError: the picture or the bake for it would not fit into memory.
        OutputError, EmbreeError, ClusterError: it cannot be written; Embree failed; the cluster is lost.
    """
    layers = check_image_target(output, half)
    needed = rendering_bytes(description.scene, description.settings, layers is None, threads)
    check_memory(source, needed, describe_work(description.scene, description.settings))
    start = time.perf_counter()
    scene, baked = with_obscurance(description, threads, baking, session)
    prepared = time.perf_counter()
    renderer = render
    if session:
        from ao.cluster.pictures import render_on

        renderer = partial(render_on, session)
    frame = renderer(scene, description.camera, description.settings, layers is None, threads, rendering)
    rendered = time.perf_counter()
    write_frame(output, frame, metadata(source, description), half)
    seconds = {"bake": prepared - start, **frame.seconds, "write": time.perf_counter() - rendered}
    return RenderedPicture(frame, baked, seconds)


def metadata(source: Path, description: SceneDescription) -> dict[str, str]:
    """Metadata of an image file: settings and version, nothing that changes from run to run."""
    names = ("samples", "seed", "shading", "normals", "obscurance")
    settings = {name: str(getattr(description.settings, name)) for name in names}
    return {"scene": source.name, "version": versions()["obscurance"], **settings}


def render_report(
    source: Path, settings: Settings, picture: RenderedPicture, threads: int, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """The report of a rendering as JSON-ready values. Args: warnings: what limits the picture."""
    bake, frame = picture.bake, picture.frame
    beauty = frame.layers["beauty"]
    skipped = {f"bake_{reason}": count for reason, count in bake.rays_skipped.items()} if bake else {}
    return {
        "schema_version": SCHEMA_VERSION,
        "scene": str(source),
        "layers": {name: layer.shape[2] for name, layer in frame.layers.items()},
        "picture": {
            "covered": float(beauty[..., 3].mean()),
            "brightest": float(beauty[..., :3].max()),
            "clipped": float((beauty[..., :3] > 1).any(axis=2).mean()),
        },
        "settings": vars(settings) | {"threads": threads},
        "rays": frame.rays | ({"bake": bake.rays} if bake else {}),
        "rays_skipped": frame.rays_skipped | skipped,
        "seconds": picture.seconds,
        "rmse_estimate": bake.rmse if bake else None,
        "error_calibration": calibration_facts(bake.calibration) if bake else None,
        "warnings": list(warnings),
        "versions": versions(),
    }
