"""`--occlusion auto`: a ramp shows w of the vertices, or textures do where they err less between them."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import ao
from ao.result import Interpolation
from raytrace.errors import MeshError
from raytrace.system.atomic import write_bytes

from ..console import progress
from ..inputs import Sources
from ..vertices import BakeCommand

_SIZE = "512"  # texels a side: meshes whose faces are too large for w at vertices are small


class AutoCommand(BakeCommand):
    """A bake to the vertices of a .glb, and to textures beside them if they err less and the file has coordinates."""

    def described(self) -> dict[str, Any]:
        return super().described() | {"occlusion": "auto"}

    def _write(self, baked: ao.Bake, sources: Sources, falloff: ao.Falloff) -> tuple[str, list[str]]:
        textures = self._textures(sources, falloff) if baked.coarse else []
        shown = _shown(baked, textures)
        if shown is None or baked.interpolation is None or shown.rmse >= baked.interpolation.rmse:
            return super()._write(baked, sources, falloff)
        from ...formats.glb.textured import textured_glb

        content, _ = textured_glb(sources.source, textures, self.replace_occlusion, w=baked.w, bake=baked)
        write_bytes(self.output, content)
        each = f"{len(textures)} textures" if len(textures) > 1 else "a texture"
        why = f"between the vertices w errs by {baked.interpolation.rmse:.2f}, in textures by {shown.rmse:.2f}"
        repeated = "faces share texels, or have none: --occlusion texture --uv unwrap gives each its own"
        more = [f"{self.output}: {repeated}"] if shown.visible else []
        return f"\nocclusion: {each} of {_SIZE}×{_SIZE}: {why}", more

    def _textures(self, sources: Sources, falloff: ao.Falloff) -> list[ao.BakedTexture]:
        """w by the file's own texture coordinates; none if it has none of use."""
        from .coordinates import coordinates
        from .pages import pages_of

        source = sources.source
        if self.interior == "mark" or source.texture_coordinates(0) is None:
            return []
        options = sources.arguments | self.arguments("texture")
        with progress(self.quiet, "rays", form=self.progress) as (advance,):
            try:
                layout = coordinates(source, "0", (_SIZE, None), True, sources.chosen)
                pages = pages_of(source, layout, self.output, False, self.threads)
                mesh = sources.chosen.mesh
                bake = partial(ao.bake_texture, mesh, size=layout.size, falloff=falloff, progress=advance)
                return [bake(page.uv, **options) for page in pages]
            except MeshError:  # no face has an area on the page
                return []


def _shown(baked: ao.Bake, textures: list[ao.BakedTexture]) -> Interpolation | None:
    """The error of w as textures show it, or the ramp where they have no texels; None without any."""
    checked = baked.interpolation
    if checked is None or not textures:
        return None
    values = np.einsum("ki,ki->k", checked.weights, baked.w[baked.mesh.faces[checked.faces]])
    for texture in textures:
        shown = texture.at(checked.faces, checked.weights)
        values = np.where(np.isnan(shown), values, shown)
    return type(checked).of(checked.faces, checked.weights, checked.estimates, values, np.zeros(len(values)))
