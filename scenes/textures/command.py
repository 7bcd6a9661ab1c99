"""`obscurance bake` to images: from a mesh file with texture coordinates to w, companions and a report."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings

from ..commands.bake import BakeCommand
from ..commands.console import compiling, note, progress, texture_summary, warn
from ..commands.options import FalloffForm, Hidden, Method, NormalsFrom, Overlap, make_falloff, parse_texels, plain

if TYPE_CHECKING:
    import ao
    from raytrace.mesh.mesh import Mesh
    from raytrace.types import Float64s

    from ..readers.load import MeshFile

_NO_OPTIONS_OF_BAKE = ("report", "quiet", "resume")  # they change no result
_OF_VERTICES = {"method": Method.vertex, "colors": False, "debug_image": None, "up": None}
_SOME = 1e-3  # of the covered texels, that may overlap without a word
_IMAGES = "output", "bent_normals", "error_map"


def bake_command(options: dict[str, Any]) -> BakeCommand | TextureCommand:
    """The command for an output.

    Raises: OptionError: an option is not for this sort of output.
    """
    from raytrace.errors import OptionError

    from .images import is_texture

    output = options["output"]
    own = {field.name for field in fields(BakeCommand)}
    if not is_texture(output):
        for name in options.keys() - own:
            if options[name]:
                raise OptionError(name, "an image output with it: .png .exr .tif", output)
        return BakeCommand(**{name: options[name] for name in own})
    for name, usual in _OF_VERTICES.items():
        if options[name] != usual:
            raise OptionError(name, "an output of vertices with it: .npy .npz .ply .glb", output)
    own = {field.name for field in fields(TextureCommand)}
    return TextureCommand(**{name: options[name] for name in own})


@dataclass(frozen=True, kw_only=True)
class TextureCommand:
    """The command with its options; `obscurance bake --help` explains each."""

    mesh: Path
    output: Path
    falloff: FalloffForm
    tau: float | None
    half_distance: str | None
    max_distance: str
    samples: int | None
    tolerance: float | None
    reconstruct: bool
    skip: bool
    seed: int
    threads: int | None
    normals: NormalsFrom
    hidden: Hidden
    report: Path | None
    resume: bool
    size: str | None
    texel_size: str | None
    uv: str | None
    overlap: Overlap | None
    bent_normals: Path | None
    error_map: Path | None
    half: bool
    quiet: bool

    def run(self) -> None:
        """Bake, write, and print a summary.

        Raises:
            InputError: an option, the mesh, or options that exclude each other.
            OutputError, MemoryLimitError, EmbreeError: as `ao.bake_texture` and when writing.
        """
        falloff = self._check()
        from raytrace.system.outputs import check_outputs

        from ..readers.load import load
        from .images import UDIM, tile_path, udim_tiles

        start = time.perf_counter()
        source = load(self.mesh, "kept.glb")
        uv = self._coordinates(source)
        size = self._page(source.mesh, uv)
        tiles = udim_tiles(uv, source.path) if UDIM in self.output.name else [None]
        outputs: dict[str, Path | None] = {"--report": self.report}
        for tile in tiles:
            for name, path in self._images().items():
                placed = path if tile is None else tile_path(path, tile)
                outputs[f"--{name.replace('_', '-')}{'' if tile is None else f' {placed.name}'}"] = placed
        check_outputs(outputs, source.files)
        loaded = time.perf_counter() - start
        warnings = warn([source.mesh], source.notes)
        reports = []
        for tile in tiles:
            images = {name: path if tile is None else tile_path(path, tile) for name, path in self._images().items()}
            moved = uv if tile is None else uv - tile
            baked, seconds, more = self._bake_page(source.mesh, moved, size, falloff, images, tile is None)
            reports.append((images["output"], baked, {"load": loaded} | seconds, [*warnings, *more]))
            if not self.quiet:
                print(texture_summary(baked, images["output"]))
        if self.report:
            self._write_report(self.report, reports)

    def _check(self) -> ao.Falloff:
        """The falloff, if the options go together and the outputs can be written. Raises: OptionError, OutputError."""
        from ao.options import Options
        from ao.texture.uv_layout import page_size
        from raytrace.errors import OptionError
        from raytrace.system.outputs import check_ending, check_outputs

        from .images import UDIM, check_texture_target

        falloff = make_falloff(self.falloff, self.tau, self.half_distance, self.max_distance)
        Options(**self._options())
        if self.hidden is Hidden.mark:
            raise OptionError("hidden", "auto, ignore or fill for a texture", "mark")
        if self.size is not None:
            if self.texel_size is not None:
                raise OptionError("texel_size", "either --size or --texel-size", "both")
            page_size(parse_texels(self.size))
        if self.uv is not None and not self.uv.isdecimal():
            raise OptionError("uv", "the number of a set of texture coordinates, such as 0", repr(self.uv))
        for name, path in self._images().items():
            check_texture_target(name, path, self.half)
            if (UDIM in path.name) != (UDIM in self.output.name):
                raise OptionError(name, f"{UDIM} in all names of images, or in none", path)
        if self.report:
            check_ending("--report", self.report, ".json")
        given: dict[str, Path | None] = {f"--{name.replace('_', '-')}": path for name, path in self._images().items()}
        check_outputs({**given, "--report": self.report}, [self.mesh])
        return falloff

    def _images(self) -> dict[str, Path]:
        return {name: getattr(self, name) for name in _IMAGES if getattr(self, name) is not None}

    def _options(self) -> dict[str, Any]:
        """The options that `ao.bake_texture` takes."""
        names = ("samples", "seed", "threads", "normals", "tolerance", "reconstruct", "hidden", "skip")
        return {name: plain(getattr(self, name)) for name in names}

    def _coordinates(self, source: MeshFile) -> Float64s:
        """Texture coordinates. Raises: MeshError: there are none."""
        from raytrace.errors import MeshError

        from ..readers.texture_coordinates import texture_coordinates

        number = int(self.uv or 0)
        uv = texture_coordinates(source, number)
        if uv is None:
            which = f" of number {number}" if number else ""
            raise MeshError(source.path, "texture coordinates", f"some{which} on every face", "none")
        return uv

    def _page(self, mesh: Mesh, uv: Float64s) -> int | tuple[int, int]:
        """Texels across and down."""
        if self.texel_size is None:
            return parse_texels(self.size or "1024")
        import numpy as np

        from ao.falloff import resolve_length
        from ao.texture.uv_layout import texels_across
        from raytrace.mesh.normals import face_normals

        length = resolve_length("texel_size", self.texel_size, mesh.radius)
        finite = uv[np.isfinite(uv).all(axis=(1, 2))]
        return texels_across(finite, face_normals(mesh.vertices, mesh.faces)[1], length)

    def _bake_page(
        self,
        mesh: Mesh,
        uv: Float64s,
        size: int | tuple[int, int],
        falloff: ao.Falloff,
        images: Mapping[str, Path],
        wrap: bool,
    ) -> tuple[ao.BakedTexture, dict[str, float], list[str]]:
        """Bake one page and write its images: what was baked, the seconds of writing, and warnings."""
        import ao
        from ao.trace.checkpoint import Checkpoint

        unmet = catch_warnings(record=True, action="always", category=ao.ToleranceWarning)
        overlap = self.overlap or Overlap.mean
        with Checkpoint(f"{images['output']}.partial", self.resume, note) as checkpoint:
            with progress(self.quiet, "rays") as (advance,), compiling("below_face"), unmet as raised:
                baked = ao.bake_texture(
                    mesh, uv, size, falloff, progress=advance, checkpoint=checkpoint, overlap=overlap.value, wrap=wrap,
                    **self._options(),
                )  # fmt: skip
            lines = [*(str(warning.message) for warning in raised), *_remarks(baked, images["output"], wrap)]
            warnings = warn([], lines)
            start = time.perf_counter()
            self._write(baked, images)
        return baked, {"write": time.perf_counter() - start}, warnings

    def _write(self, baked: ao.BakedTexture, images: Mapping[str, Path]) -> None:
        from .images import write_error, write_normals, write_w

        metadata = {"content": "w, 1 = open", "seed": str(self.seed)}
        write_w(images["output"], baked, self.half, metadata)
        if "bent_normals" in images:
            described = {"content": "bent normals in the space of the mesh"}
            write_normals(images["bent_normals"], baked.bent_normals, self.half, described)
        if "error_map" in images:
            write_error(images["error_map"], baked, self.half, {"content": "standard error of w"})

    def _write_report(self, path: Path, pages: list[tuple[Path, ao.BakedTexture, dict[str, float], list[str]]]) -> None:
        from ao.report import report
        from raytrace.system.atomic import write_json
        from raytrace.system.threads import thread_count

        options = {name: plain(value) for name, value in vars(self).items() if name not in _NO_OPTIONS_OF_BAKE}
        options["threads"] = thread_count(self.threads)
        reports = [report(baked, options, seconds, warnings) for _, baked, seconds, warnings in pages]
        whole = reports[0]
        if len(pages) > 1:
            whole = {"pages": {str(page[0]): made for page, made in zip(pages, reports, strict=True)}}
        write_json(path, whole)


def _remarks(baked: ao.BakedTexture, target: Path, wrap: bool) -> list[str]:
    """What of the texture coordinates the user should know."""
    from .images import UDIM

    facts = baked.facts
    lines = []
    if facts.overlapping > _SOME * facts.covered:
        mirrored = f"; {facts.mirrored:,} faces are mirrored" if facts.mirrored else ""
        lines.append(f"faces overlap in {facts.overlapping / facts.covered:.1%} of the covered texels{mirrored}")
    if facts.outside and wrap:
        advice = f"{UDIM} in the output's name would keep tiles apart"
        lines.append(f"{facts.outside:,} faces reach out of the unit square and are taken modulo 1; {advice}")
    if facts.flat:
        lines.append(f"{facts.flat:,} faces have no area in texture space, and no texels")
    return [f"{target}: {line}" for line in lines]
