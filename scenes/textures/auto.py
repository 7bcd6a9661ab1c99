"""`--occlusion auto`: a ramp shows w of the vertices, or textures do where interpolation between them errs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..commands.bake import BakeCommand

if TYPE_CHECKING:
    import ao

    from ..readers.load import MeshFile
    from .coordinates import Coordinates
    from .pages import Page

_ROUNDED = 1e-6  # of texture coordinates


@dataclass(frozen=True, kw_only=True)
class AutoCommand(BakeCommand):
    """A bake to the vertices of a .glb, and to textures beside them if they need it and the file has coordinates."""

    def described(self) -> dict[str, Any]:
        return super().described() | {"occlusion": "auto"}

    def _write(self, baked: ao.Bake, source: MeshFile, falloff: ao.Falloff) -> tuple[str, list[str]]:
        import ao
        from raytrace.system.atomic import atomic_write

        from ..writers.textured_glb import textured_glb

        layout = self._layout(source) if baked.coarse else None
        if layout is None:
            told, warnings = super()._write(baked, source, falloff)
            return f"{told}\nocclusion: a ramp shows w of the vertices", warnings
        found, pages = layout
        options = {name: value for name, value in self.options().items() if name != "method"}
        textures = [ao.bake_texture(source.mesh, page.uv, found.size, falloff, **options) for page in pages]
        content, _ = textured_glb(source, textures, self.replace_occlusion, w=baked.w, attribute=True)
        with atomic_write(self.output) as file:
            file.write(content)
        assert baked.interpolation is not None
        each = f"{len(pages)} textures" if len(pages) > 1 else "a texture"
        why = f"between the vertices w errs by {baked.interpolation.rmse:.2f}"
        return f"\nocclusion: {each} of {found.size[0]}×{found.size[1]}, as {why}", []

    def _layout(self, source: MeshFile) -> tuple[Coordinates, list[Page]] | None:
        """The file's own texture coordinates and their pages; None if it has none, or they repeat images."""
        import numpy as np

        from .coordinates import coordinates
        from .pages import pages_of

        uv = source.texture_coordinates(0)
        if uv is None or self.hidden == "mark" or np.nanmin(uv) < -_ROUNDED or np.nanmax(uv) > 1 + _ROUNDED:
            return None
        found = coordinates(source, "0", None, None, True)
        return found, pages_of(source, found, self.output, False, self.threads)
