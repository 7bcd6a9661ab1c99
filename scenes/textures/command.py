"""`obscurance bake` to images: from a mesh file with texture coordinates to w, companions and a report."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..commands.bake import BakeCommand, MeshBake, Work, Written
from ..commands.console import KERNELS_OF_TEXTURE, progress, texture_summary, warn
from ..commands.options import CAGE, BentSpace, Overlap, check_cage, parse_texels

if TYPE_CHECKING:
    import ao
    from raytrace.mesh.mesh import Mesh
    from raytrace.types import Float64s

    from ..readers.load import MeshFile
    from ..report.pictures import Picture

_OF_VERTICES = {"method": "vertex", "colors": False, "debug_image": None, "up": None}
AUTO, UNWRAP = "auto", "unwrap"
_USED = 0.65  # of a page, that an unwrapping fills
_SOME = 1e-3  # of the covered texels, that may overlap without a word
_IMAGES = "output", "bent_normals", "error_map"


def bake_command(options: dict[str, Any]) -> BakeCommand | TextureCommand:
    """The command for an output.

    Raises: OptionError: the output's ending is unknown, or an option is not for this sort of output.
    """
    from raytrace.errors import OptionError
    from raytrace.system.outputs import check_ending

    from ..writers.write import ENDINGS
    from .names import ENDINGS as IMAGES
    from .names import is_texture

    output = options["output"]
    check_ending("output", output, *ENDINGS, *IMAGES)
    own = {field.name for field in fields(BakeCommand)}
    into_glb = options["occlusion"] == "texture"
    if into_glb and output.suffix.lower() != ".glb" and not is_texture(output):
        raise OptionError("occlusion", "a .glb output with texture", output)
    if not is_texture(output) and not into_glb:
        for name in options.keys() - own:
            if options[name]:
                raise OptionError(name, "with it an image to write, or --occlusion texture", output)
        return BakeCommand(**{name: value for name, value in options.items() if name in own})
    for name, usual in _OF_VERTICES.items():
        if options[name] != usual:
            raise OptionError(name, "w at vertices, not in a texture, with it", output)
    own = {field.name for field in fields(TextureCommand)}
    return TextureCommand(**{name: value for name, value in options.items() if name in own})


@dataclass(frozen=True)
class _Source:
    """What is baked.

    Attributes:
        file: the mesh with the texture. fine: the one whose w it shows, None for its own.
        uv: the number of its texture coordinates or new ones (m, 3, 2); None for one of several tiles.
    """

    file: MeshFile
    uv: int | Float64s | None
    fine: MeshFile | None


@dataclass(frozen=True, kw_only=True)
class TextureCommand(MeshBake):
    """A bake to a texture."""

    mesh_output: Path | None
    size: str | None
    texel_size: str | None
    uv: str | None
    overlap: Overlap | None
    bent_normals: Path | None
    bent_space: BentSpace | None
    error_map: Path | None
    half: bool
    orm: bool

    @property
    def kernels(self) -> int:
        return KERNELS_OF_TEXTURE

    @property
    def side_by_side(self) -> bool:
        return False

    @property
    def kept(self) -> Path:
        return Path("texture.glb")

    def work(self, source: MeshFile, falloff: ao.Falloff) -> Work:
        import ao
        from ao.memory import texture_bytes
        from ao.options import Options
        from ao.texture.uv_layout import page_size

        from ..readers.load import load

        _, uv, size = self._coordinates(source)
        width, height = page_size(size)
        high = None if self.high is None else load(self.high).mesh
        solid = high or source.mesh
        rays = Options(**self.options()).rays
        needed = texture_bytes(width * height, len(solid.vertices), len(solid.faces), rays)

        def trial(count: int) -> int:
            side = max(int(count**0.5), 1)
            ao.bake_texture(source.mesh, uv, side, falloff, high=high, cage=self.cage or CAGE, **self.options())
            return side * side

        return Work(width * height, "texels", needed, trial)

    def bake(self, falloff: ao.Falloff) -> Iterator[Written]:
        from raytrace.system.outputs import check_outputs

        from ..readers.load import load
        from .images import tile_path, udim_tiles
        from .names import UDIM

        start = time.perf_counter()
        source = self.read()
        number, uv, size = self._coordinates(source)
        tiles = udim_tiles(uv, source.path) if UDIM in self.output.name else [None]
        outputs: dict[str, Path | None] = {"--report": self.report, "--mesh-output": self.mesh_output}
        for tile in tiles:
            for name, path in self._images().items():
                placed = path if tile is None else tile_path(path, tile)
                outputs[f"--{name.replace('_', '-')}{'' if tile is None else f' {placed.name}'}"] = placed
        if self.orm:
            from .orm import check_orm

            check_orm(source.gltf, number, self.replace_occlusion)
        fine = None if self.high is None else load(self.high)
        check_outputs(outputs, [*source.files, *(fine.files if fine else ())])
        loaded = time.perf_counter() - start
        inputs = self.hashed([*source.files, *(fine.files if fine else ())])
        meshes = [source.mesh, fine.mesh] if fine else [source.mesh]
        warnings = warn(meshes, [*source.notes, *(fine.notes if fine else ())])
        reports, uvs = [], []
        for tile in tiles:
            images = {name: path if tile is None else tile_path(path, tile) for name, path in self._images().items()}
            moved = uv if tile is None else uv - tile
            scene = _Source(source, None if tile is not None else uv if number is None else number, fine)
            baked, seconds, more = self._bake_page(scene, moved, size, falloff, images)
            reports.append((images["output"], baked, {"load": loaded} | seconds, [*warnings, *more]))
            uvs.append(moved)
            yield Written(texture_summary(baked, images["output"]), [*warnings, *more])
        if self.report:
            self._write_report(self.report, reports, inputs, (source.mesh, uvs))

    def check_own(self) -> None:
        from ao.texture.uv_layout import page_size
        from raytrace.errors import OptionError
        from raytrace.system.outputs import check_ending

        from .images import check_texture_target
        from .names import UDIM

        if self.hidden == "mark":
            raise OptionError("hidden", "auto, ignore or fill for a texture", "mark")
        if self.size is not None:
            if self.texel_size is not None:
                raise OptionError("texel_size", "either --size or --texel-size", "both")
            page_size(parse_texels(self.size))
        if self.uv not in (None, AUTO, UNWRAP) and not (self.uv.isdecimal() and len(self.uv) < 4):
            raise OptionError("uv", "auto, unwrap or the number of a set of texture coordinates", repr(self.uv))
        glb = self._glb()
        for name, path in self._images().items():
            if path != glb:
                check_texture_target(name, path, self.half)
            if (UDIM in path.name) != (UDIM in self.output.name):
                raise OptionError(name, f"{UDIM} in all names of images, or in none", path)
        if self.mesh_output is not None:
            check_ending("mesh_output", self.mesh_output, ".glb")
            if glb == self.output or UDIM in self.output.name:
                raise OptionError("mesh_output", "an image of one page as --output with it", self.output)
        if self.replace_occlusion and glb is None:
            raise OptionError("replace_occlusion", "an occlusion texture to write to a .glb", "none")
        if self.orm and glb is None:
            raise OptionError("orm", "a .glb to write, as --output or --mesh-output", self.output)
        if self.occlusion not in (None, "texture"):
            raise OptionError("occlusion", "texture for a texture", self.occlusion)
        if self.uv == UNWRAP and glb is None:
            raise OptionError("uv", "--mesh-output, for the coordinates that unwrap makes", "none")
        if self.half and glb == self.output and len(self._images()) == 1:
            raise OptionError("half", "images that end in .exr or .tif", self.output)
        if self.bent_space is not None and self.bent_normals is None:
            raise OptionError("bent_space", "--bent-normals with it", "none")
        check_cage(self.cage, self.high)

    def outputs(self) -> dict[str, Path | None]:
        images = {f"--{name.replace('_', '-')}": path for name, path in self._images().items()}
        return {**images, "--report": self.report, "--mesh-output": self.mesh_output}

    def _images(self) -> dict[str, Path]:
        return {name: getattr(self, name) for name in _IMAGES if getattr(self, name) is not None}

    def _glb(self) -> Path | None:
        """The .glb to write, if there is one."""
        return self.output if self.output.suffix.lower() == ".glb" else self.mesh_output

    def _coordinates(self, source: MeshFile) -> tuple[int | None, Float64s, int | tuple[int, int]]:
        """The number of the set of texture coordinates, None for new ones; the coordinates; texels across and down.

        Raises: MeshError: there are none.
        """
        from raytrace.errors import MeshError

        from ..readers.texture_coordinates import texture_coordinates
        from .unwrap import has_unwrapper, unwrap

        wanted = self.uv or AUTO
        if wanted != UNWRAP:
            number = 0 if wanted == AUTO else int(wanted)
            uv = texture_coordinates(source, number)
            if uv is not None:
                return number, uv, self._page(source.mesh, uv)
            if wanted != AUTO or self._glb() is None or not has_unwrapper():
                which = f" of number {number}" if number else ""
                install = "" if has_unwrapper() else "pip install 'obscurance[unwrap]' and "
                advice = f"; {install}--uv unwrap makes some"
                raise MeshError(source.path, "texture coordinates", f"some{which} on every face", f"none{advice}")
        side = self._page(source.mesh, None)
        side = side if isinstance(side, int) else min(side)
        return None, unwrap(source.mesh, side), side

    def _page(self, mesh: Mesh, uv: Float64s | None) -> int | tuple[int, int]:
        """Texels across and down; where faces are to be unwrapped, they are taken to fill most of the page."""
        if self.texel_size is None:
            return parse_texels(self.size or "1024")
        import numpy as np

        from ao.falloff import resolve_length
        from ao.texture.uv_layout import texels_across
        from raytrace.mesh.normals import face_normals

        length = resolve_length("texel_size", self.texel_size, mesh.radius)
        areas = face_normals(mesh.vertices, mesh.faces)[1]
        if uv is None:
            share = np.sqrt(2 * _USED / len(areas))
            uv = np.tile([[0.0, 0.0], [share, 0.0], [0.0, share]], (len(areas), 1, 1))
        return texels_across(uv[np.isfinite(uv).all(axis=(1, 2))], areas, length)

    def _bake_page(
        self,
        source: _Source,
        uv: Float64s,
        size: int | tuple[int, int],
        falloff: ao.Falloff,
        images: Mapping[str, Path],
    ) -> tuple[ao.BakedTexture, dict[str, float], list[str]]:
        """Bake one page and write its images: what was baked, the seconds of writing, and warnings."""
        import ao

        overlap, wrap = self.overlap or "mean", source.uv is not None
        with self.checkpoint(images["output"]) as checkpoint:
            status = checkpoint.status if checkpoint else str
            with progress(self.quiet, "rays", form=self.progress, status=status) as (advance,):
                baked = ao.bake_texture(
                    source.file.mesh, uv, size, falloff, progress=advance, checkpoint=checkpoint, overlap=overlap,
                    wrap=wrap, high=source.fine.mesh if source.fine else None, cage=self.cage or CAGE,
                    bent_space=self.bent_space or "world",
                    **self.options(),
                )  # fmt: skip
            lines = [*baked.shortfalls, *_remarks(baked, images["output"], wrap)]
            start = time.perf_counter()
            lines += self._write(baked, images, source)
            warnings = warn([], lines)
        return baked, {"write": time.perf_counter() - start}, warnings

    def _write(self, baked: ao.BakedTexture, images: Mapping[str, Path], source: _Source) -> list[str]:
        """Write all files of a page; returns warnings."""
        from raytrace.system.atomic import atomic_write

        from .glb import textured_glb
        from .images import write_error, write_normals, write_w

        glb, kept = self._glb(), 0
        if glb is not None and source.uv is not None:
            content, kept = textured_glb(source.file, baked, source.uv, self.replace_occlusion, self.orm)
            with atomic_write(glb) as file:
                file.write(content)
        if images["output"] != glb:
            write_w(images["output"], baked, self.half, {"content": "w, 1 = open", "seed": str(self.seed)})
        if "bent_normals" in images:
            space = "tangent space, +Y up" if self.bent_space == "tangent" else "the space of the mesh"
            described = {"content": f"bent normals in {space}"}
            write_normals(images["bent_normals"], baked.bent_normals, self.half, described)
        if "error_map" in images:
            write_error(images["error_map"], baked, self.half, {"content": "standard error of w"})
        advice = "whose w viewers do not show; --replace-occlusion replaces them"
        return [f"{glb}: keeps the occlusion textures of {kept:,} primitives, {advice}"] if kept else []

    def _write_report(
        self,
        path: Path,
        pages: list[tuple[Path, ao.BakedTexture, dict[str, float], list[str]]],
        inputs: list[dict[str, Any]],
        shown: tuple[Mesh, list[Float64s]],
    ) -> None:
        """Args: inputs: what was read. shown: the mesh, and its texture coordinates on each page."""
        from ao.report import report

        from ..description.defaults import up_axis
        from ..report.complete import complete, write_report

        options = self.described()
        reports = [report(baked, options, seconds, warnings) for _, baked, seconds, warnings in pages]
        whole = reports[0]
        if len(pages) > 1:
            whole = {"pages": {str(page[0]): made for page, made in zip(pages, reports, strict=True)}}

        def pictures() -> list[list[Picture]]:
            from ..report.pictures import Page, pictures_of_page

            mesh = shown[0] if len(pages) == 1 else None
            made = [Page(baked.w, baked.error, uv) for (_, baked, *_), uv in zip(pages, shown[1], strict=True)]
            return [pictures_of_page(mesh, page, up_axis(self.mesh)) for page in made]

        write_report(path, complete("bake", "mesh", whole, inputs, options), pictures)


def _remarks(baked: ao.BakedTexture, target: Path, wrap: bool) -> list[str]:
    """What of the texture coordinates the user should know."""
    from .names import UDIM

    facts = baked.facts
    lines = []
    if facts.overlapping > _SOME * facts.covered:
        mirrored = f"; {facts.mirrored:,} faces are mirrored" if facts.mirrored else ""
        lines.append(f"faces overlap in {facts.overlapping / facts.covered:.1%} of the covered texels{mirrored}")
    if facts.outside and wrap:
        advice = f"{UDIM} in the output's name would keep tiles apart"
        lines.append(f"{facts.outside:,} faces reach out of the unit square and are taken modulo 1; {advice}")
    if facts.missed:
        lines.append(f"{facts.missed:,} points are not within the cage of the fine mesh and take the closest of it")
    if facts.flat:
        lines.append(f"{facts.flat:,} faces have no area in texture space, and no texels")
    return [f"{target}: {line}" for line in lines]
