"""`obscurance bake` to vertices: from a mesh file to w, a report and an image of the flagged vertices."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import ao
from ao.options import VertexOptions
from raytrace.errors import ConflictError
from raytrace.system.checks import check_outputs

from ..write_bake import channels, check_target, write
from .bake import MeshBake, WorkSize, Written
from .console import COARSE, alpha_summary, bake_summary, progress, warn
from .inputs import Sources
from .options import named

if TYPE_CHECKING:
    from ..formats.load import MeshFile
    from ..show.report.pictures import Picture


class BakeCommand(MeshBake):
    sort = "vertices"
    record = VertexOptions

    def work(self, source: MeshFile, falloff: ao.Falloff) -> WorkSize:
        from ao.memory import column_bytes, surface_bytes, vertex_bytes
        from raytrace.mesh.normals import face_normals

        sources = self.sources_of(source)
        chosen, checked = sources.chosen, self.checked()
        used = np.zeros(len(chosen.mesh.vertices), np.bool_)
        used[chosen.mesh.faces[face_normals(chosen.mesh.vertices, chosen.mesh.faces)[1] > 0]] = True
        points = int(np.count_nonzero(used if chosen.only is None else used & chosen.only))
        needed = surface_bytes(*sources.counts)
        if self.method == "vertex":
            needed = vertex_bytes(*sources.counts, checked.rays, points) + column_bytes(points, checked.columns)
        return WorkSize(points, "vertices", needed)

    def bake(self, falloff: ao.Falloff) -> Iterator[Written]:
        from ..formats.unsupported import unsupported_features

        start = time.perf_counter()
        source = self.read()
        sources = self.sources_of(source)
        check_outputs(self.outputs(), sources.files)
        loaded = time.perf_counter()
        inputs = self.hashed(sources.files)
        losses = unsupported_features(self.output, source, channels(self.output, **self._channels()))
        warnings = warn(sources.meshes, [*sources.notes, *losses], falloff)
        with self.checkpoint(self.output) as checkpoint:
            with progress(self.quiet, "rays", form=self.progress, status=checkpoint.status) as (advance,):
                if self.occluded_by == "all":
                    baked = ao.bake(
                        sources.chosen.mesh, falloff, progress=advance, checkpoint=checkpoint, only=sources.chosen.only,
                        **sources.arguments, **self.arguments(),
                    )  # fmt: skip
                else:
                    baked = self._bake_parts(sources, falloff)
            missed = baked.flagged["missed"]
            outside = f"{missed:,} vertices are not within the cage of the fine mesh and take the closest point of it"
            warnings += warn([], [*baked.shortfalls, *([f"{self.output}: {outside}"] if missed else [])])
            tracing = time.perf_counter()
            shown, more = self._write(baked, sources, falloff)
            warnings += warn([], more)
        seconds = {"load": loaded - start, "write": time.perf_counter() - tracing}
        if self.report:
            from ao.report import report

            def pictures() -> list[list[Picture]]:
                from ..show.report.pictures import pictures_of_vertices

                return [pictures_of_vertices(source.mesh, baked.w, baked.error)]

            self.write_report(report(baked, self.described(), seconds, warnings), inputs, pictures)
        if self.debug_image:
            from ..show.report.pictures import write_marked

            write_marked(self.debug_image, source.mesh, baked)
        yield (bake_summary(baked, self.output) + alpha_summary(sources.fine or source.mesh) + shown, warnings)

    def _bake_parts(self, sources: Sources, falloff: ao.Falloff) -> ao.Bake:
        """Bake groups of objects one by one; vertices of several groups have w of the last."""
        from ao.estimate.calibration import Calibration

        chosen, parts = sources.chosen, list[ao.Bake]()
        only, count = chosen.only, len(chosen.mesh.vertices)
        values: dict[str, Any] = {"w": np.ones(count), "error": np.zeros(count), "bent_normals": np.zeros((count, 3))}
        values["flags"] = np.full(count, ao.Flag.UNREFERENCED, np.uint8)
        values["flags"][chosen.mesh.faces] = 0
        for vertices, mesh in chosen.parts():
            wanted = None if only is None else only[vertices]
            part = ao.bake(mesh, chosen.absolute(falloff), only=wanted, **sources.arguments, **self.arguments())
            for name, each in values.items():
                each[vertices] = getattr(part, name)
            parts.append(part)
        calibrations = [part.calibration for part in parts if part.calibration]
        columns = ([getattr(each, name) for each in calibrations] for name in ("estimated", "measured"))
        rmse = float(np.sqrt(np.sum(values["error"] ** 2) / max(count if only is None else int(only.sum()), 1)))
        return ao.Bake(
            **values, mesh=chosen.mesh, mu=parts[0].mu, rmse=rmse, rmses=(rmse,), rays=sum(part.rays for part in parts),
            rays_skipped=_sums([part.rays_skipped for part in parts]), seconds=_sums([part.seconds for part in parts]),
            shortfalls=tuple(dict.fromkeys(line for part in parts for line in part.shortfalls)),
            calibration=Calibration(*map(np.concatenate, columns)) if calibrations else None,
        )  # fmt: skip

    def check_own(self) -> None:
        if self.high is not None and self.method == "surface":
            raise ConflictError("high", "does not go with", ("method", "surface"))
        if self.profile and not self.part and self.output.suffix.lower() == ".npy":
            raise ConflictError("profile", "needs", "an output that holds one: .npz .ply .glb .html")
        check_target(self.output)
        channels(self.output, **self._channels())
        if self.debug_image:
            from raytrace.image.write import check_image_target

            with named("debug_image"):
                check_image_target(self.debug_image, layers=("beauty",))
        self.check_up(self.debug_image, self.output)

    def outputs(self) -> dict[str, Path | None]:
        return {"--output": self.output, "--report": self.report, "--debug-image": self.debug_image}

    def described(self) -> dict[str, Any]:
        ramp = channels(self.output, **self._channels()).ramp
        return super().described() | {"occlusion": "ramp" if ramp else "none"}

    def _channels(self) -> dict[str, Any]:
        return {"colors": self.colors, "occlusion": self.occlusion, "replace_occlusion": self.replace_occlusion}

    def _write(self, baked: ao.Bake, sources: Sources, falloff: ao.Falloff) -> tuple[str, list[str]]:
        """Write the output: what to add to the summary, and warnings. Args: falloff: of textures."""
        write(self.output, baked, sources.source, **self._channels())
        if not baked.coarse or baked.interpolation is None:
            return "", []
        fit = "" if self.method == "surface" else "--method surface, "
        instead = f"--occlusion texture for a .glb, -o NAME.png, {fit}or smaller faces"
        text = f"{COARSE} {baked.interpolation.rmse:.2f}, the faces are too large for it"
        return "", [f"{self.output}: {text}: {instead}"]


def _sums(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {name: sum(table.get(name, 0) for table in tables) for name in dict.fromkeys(k for t in tables for k in t)}
