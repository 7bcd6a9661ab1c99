"""`obscurance bake` to images: from a mesh file with texture coordinates to w, companions and a report."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

import ao
from ao.memory import column_bytes, texture_bytes
from ao.options import TextureOptions
from ao.report import report
from ao.texture.uv_layout import on_page, page_size
from raytrace.errors import ConflictError, OptionError, Relation, Term
from raytrace.mesh.mesh import Mesh
from raytrace.system.atomic import write_bytes
from raytrace.system.checks import check_ending, check_outputs

from ...formats.images import MATERIAL, PLACEHOLDERS, UDIM, check_texture_target, write_grey, write_normals
from ...formats.load import MeshFile
from ...formats.primitive_groups import primitive_groups
from ..bake import MeshBake, WorkSize, Written
from ..console import alpha_summary, progress, texture_summary, warn
from ..inputs import Sources
from .coordinates import Coordinates, coordinates, parse_texels
from .pages import Page, check_area, lacking, layout_remarks, pages_of

if TYPE_CHECKING:
    from ...show.report.pictures import Picture


class BakedPage(NamedTuple):
    """A page as reports have it."""

    title: str
    baked: ao.BakedTexture
    seconds: dict[str, float]  # of reading and writing
    warnings: list[str]


class TextureCommand(MeshBake):
    sort = "texture"
    record = TextureOptions

    def work(self, source: MeshFile, falloff: ao.Falloff) -> WorkSize:
        sources, options = self.sources_of(source), self.checked()
        found, pages = self._layout(sources)
        width, height = found.size
        needed = texture_bytes(width * height, *sources.counts, options.rays)
        needed += column_bytes(width * height, options.columns)
        return WorkSize(len(pages) * width * height, "texels", needed)

    def bake(self, falloff: ao.Falloff) -> Iterator[Written]:
        start = time.perf_counter()
        source = self.read()
        sources = self.sources_of(source)
        found, pages = self._layout(sources)
        check_outputs(self.outputs(pages), sources.files)
        loaded = time.perf_counter() - start
        inputs, glb = self.hashed(sources.files), self._glb()
        remarks = lacking(source, found.uv, sources.chosen.receive, glb)
        if found.cramped:
            smaller = f"{found.cramped:,} faces show texels of others, for their charts are smaller"
            remarks.append(f"{source.path}: {smaller}; a larger --size or --uv unwrap gives them texels")
        warnings = warn(sources.meshes, [*sources.notes, *remarks], falloff)
        falloff = sources.chosen.absolute(falloff)
        bakes: list[BakedPage] = []
        with ExitStack() as kept:
            for page in pages:
                with ExitStack() as own:
                    keep = kept if glb and not self.open_checkpoint else own  # until the .glb is written
                    baked, lines = self._bake_page(sources, page, found, falloff, (len(pages), len(bakes), keep))
                    more = warn([], [line for line in lines if not any(line in each.warnings for each in bakes)])
                    begun = time.perf_counter()
                    self._write_images(baked, page)
                    seconds = {"load": loaded, "write": time.perf_counter() - begun}
                bakes.append(BakedPage(self._title(page), baked, seconds, [*warnings, *more]))
                if not glb:
                    summary = texture_summary(baked, bakes[-1].title) + alpha_summary(sources.fine or source.mesh)
                    yield (summary, bakes[-1].warnings)
            if glb:
                begun = time.perf_counter()
                lines = self._write_glb(glb, sources, [each.baked for each in bakes], falloff)
                bakes[-1].warnings.extend(lines)
                bakes[-1].seconds["write"] += time.perf_counter() - begun
                summary = "\n".join(texture_summary(each.baked, each.title) for each in bakes)
                summary += alpha_summary(sources.fine or source.mesh)
                yield (summary, list(dict.fromkeys(line for each in bakes for line in each.warnings)))
        if self.report:
            self._write_report(bakes, inputs, source.mesh)

    def check_own(self) -> None:
        if self.size is not None:
            page_size(parse_texels(self.size))
        if self.uv not in (None, "auto", "unwrap", "fill", "pack") and not (self.uv.isdecimal() and len(self.uv) < 4):
            expected = "auto, unwrap, fill, pack or the number of a set of texture coordinates"
            raise OptionError("uv", expected, repr(self.uv))
        glb = self._glb()
        for name, path in self._images().items():
            if path != glb:
                check_texture_target(name, path, self.half)
            for placeholder in PLACEHOLDERS:
                if path == glb and placeholder in path.name:
                    raise OptionError(name, f"{placeholder} in names of images alone: a .glb holds all textures", path)
                is_free = glb == self.output and placeholder == MATERIAL  # its sets have names
                if (placeholder in path.name) != (placeholder in self.output.name) and not is_free:
                    raise OptionError(name, f"{placeholder} in all names of images, or in none", path)
        if self.mesh_output is not None:
            check_ending("mesh_output", self.mesh_output, ".glb")
        one_page = glb != self.output and UDIM not in self.output.name
        endings = [path.suffix.lower() for path in (self.output, self.bent_normals) if path]
        holds_profile = self.part or endings[0] == ".exr"
        against: Relation = "does not go with"
        conflicts: list[tuple[object, Term, Relation, Term]] = [
            (self.mesh_output and not one_page, "mesh_output", "needs", "an image of one page as --output"),
            (self.replace_occlusion and not glb, "replace_occlusion", "needs", "a .glb to write"),
            (glb and self.occluded_by != "all", ("occluded_by", self.occluded_by), against, "textures in a .glb"),
            (self.orm and not glb, "orm", "needs", "a .glb to write, as --output or --mesh-output"),
            (self.occlusion not in (None, "texture"), ("occlusion", self.occlusion), against, "a texture"),
            (self.uv in ("unwrap", "pack") and self.instances != "mean", "instances", against, ("uv", self.uv)),
            (self.uv in ("unwrap", "fill", "pack") and not glb, ("uv", self.uv), "needs", "mesh_output"),
            (self.half and [glb] == list(self._images().values()), "half", "needs", "images that end in .exr or .tif"),
            (self.bits and ".png" not in endings, "bits", "needs", "w or bent normals in an image that ends in .png"),
            (self.profile and not holds_profile, "profile", "needs", "a texture that holds one: .exr"),
        ]
        for conflicting, first, relation, second in conflicts:
            if conflicting:
                raise ConflictError(first, relation, second)
        self.check_up(None, glb)

    def outputs(self, pages: Sequence[Page] = ()) -> dict[str, Path | None]:
        """The files to write, by what the user calls them; without `pages`, as far as the options name them.

        Raises: OptionError: several pages have one name for an image.
        """
        outputs: dict[str, Path | None] = {"--report": self.report, "--mesh-output": self.mesh_output}
        for name, path in self._images().items():
            option = f"--{name.replace('_', '-')}"
            if len(pages) > 1 and path != self._glb() and pages[0].path(path) == path:
                raise OptionError(name, f"{MATERIAL} in its name: overlapping materials have a texture each", path)
            for placed in [page.path(path) for page in pages] or [path]:
                outputs[option if placed == path else f"{option} {placed.name}"] = placed
        return outputs

    def _images(self) -> dict[str, Path]:
        paths = {"output": self.output, "bent_normals": self.bent_normals, "error_map": self.error_map}
        return {name: path for name, path in paths.items() if path is not None}

    def _glb(self) -> Path | None:
        return self.output if self.output.suffix.lower() == ".glb" else self.mesh_output

    def _layout(self, sources: Sources) -> tuple[Coordinates, list[Page]]:
        """The texture coordinates, and the pages. Raises: as `coordinates`, `pages_of`, `ObjectSelection.of_page`."""
        source, page = sources.source, (self.size, self.texel_size)
        glb, mixed = self._glb(), self.overlap is not None
        sets = glb == self.output and not self.orm and not mixed
        found = coordinates(source, self.uv or "auto", page, glb is not None, sources.chosen, sets)
        pages = pages_of(source, found, self.output, mixed, self.threads, self.instances)
        for each in pages:
            check_area(source, each)
            sources.chosen.of_page(each.uv)
        return found, pages

    def _title(self, page: Page) -> str:
        return f"{page.path(self.output)}{f', {page.name}' if page.name else ''}"

    def _bake_page(
        self, sources: Sources, page: Page, found: Coordinates, falloff: ao.Falloff, place: tuple[int, int, ExitStack]
    ) -> tuple[ao.BakedTexture, list[str]]:
        """What was baked, and warnings to print. Args: place: of how many pages, which, and what closes its journal."""
        pages, number, stack = place
        target = page.path(self.output) if not page.name or not number else Path(f"{self.output}.{number + 1}")
        checkpoint = stack.enter_context(self.checkpoint(target))
        if pages > 1 and checkpoint.partial:
            sets = f"{pages} texture sets that overlap, but with --overlap mean"
            raise ConflictError("part", "does not go with", sets)
        with progress(self.quiet, "rays", form=self.progress, status=checkpoint.status) as (advance,):
            baked = ao.bake_texture(
                sources.chosen.of_page(page.uv), page.uv, found.size, falloff, progress=advance, checkpoint=checkpoint,
                wrap=page.wraps, **sources.arguments, **self.arguments(),
            )  # fmt: skip
        if page.shown is not None:
            baked = replace(baked, uv=page.shown)
        remarks = layout_remarks(baked, page.wraps, self._glb() != self.output)
        return baked, [*baked.shortfalls, *(f"{self._title(page)}: {line}" for line in remarks)]

    def _write_images(self, baked: ao.BakedTexture, page: Page) -> None:
        bits = int(self.bits or 16)
        images = {name: page.path(path) for name, path in self._images().items()}
        if images["output"] != self._glb():
            described = {"content": "w, 1 = open", "seed": str(self.seed)}
            write_grey(images["output"], baked.w, self.half, described, bits, baked.profile)
        if "bent_normals" in images:
            space = {"tangent": "tangent space, +Y", "tangent-directx": "tangent space, -Y"}.get(self.bent_space)
            described = {"content": f"bent normals in {space or 'the space of the mesh'}"}
            write_normals(images["bent_normals"], baked.bent_normals, self.half, described, bits)
        if "error_map" in images:
            write_grey(images["error_map"], baked.error, self.half, {"content": "standard error of w"})

    def _write_glb(
        self, path: Path, sources: Sources, baked: Sequence[ao.BakedTexture], falloff: ao.Falloff
    ) -> list[str]:
        """Write the .glb, with w of vertices where there are no texture coordinates; returns warnings."""
        from ...formats.gltf.textured import textured_glb

        source, chosen, w = sources.source, sources.chosen, None
        uncovered = chosen.receive & ~np.any([on_page(each.uv) for each in baked], axis=0)
        if uncovered.any():
            only = np.zeros(len(source.mesh.vertices), np.bool_)
            for piece in primitive_groups(source):
                only[source.mesh.faces[piece.faces]] |= uncovered[piece.faces].any()
            w = ao.bake(chosen.mesh, falloff, only=only, **sources.arguments, **self.arguments("vertices")).w
        content, lines = textured_glb(source, baked, self.replace_occlusion, self.orm, w)
        write_bytes(path, content)
        return warn([], [f"{path}: {line}" for line in lines])

    def _write_report(self, made: Sequence[BakedPage], inputs: list[dict[str, Any]], mesh: Mesh) -> None:
        options = self.described()
        reports = [report(each.baked, options, each.seconds, each.warnings) for each in made]
        whole = reports[0]
        if len(made) > 1:
            whole = {"pages": {each.title: about for each, about in zip(made, reports, strict=True)}}

        def pictures() -> list[list[Picture]]:
            from ...show.report.pictures import pictures_of_page

            shown = mesh if len(made) == 1 else None
            return [pictures_of_page(shown, each.baked) for each in made]

        self.write_report(whole, inputs, pictures)
