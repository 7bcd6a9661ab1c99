"""A baked texture, assembled from estimates at covered texels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from raytrace.image.encode import linear_png
from raytrace.image.fill import fill_holes
from raytrace.kernel.jit import bind, kernel
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import normalize
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s

from ..estimate.calibration import Calibration
from ..mu import Mu
from ..result import Columns
from .texels import Texels
from .uv_layout import UVLayout

if TYPE_CHECKING:
    from .seams import Seams

_BLOCK, _SHARE = 1 << 12, 16  # texels, and blocks at once
_ROWS = 1 << 4  # of the page


@dataclass(frozen=True, eq=False)
class TextureFacts:
    """Facts about a layout of texture coordinates."""

    covered: int  # texels that faces reach into
    overlapping: int  # texels in which faces lie over one another
    hidden: int  # texels that are filled because they lie inside solids
    missed: int  # points that the cage missed
    mirrored: int  # faces that are turned over
    flat: int  # faces that have no area on the page
    outside: int  # faces that reach out of the unit square
    seam_edges: int  # that lie at two places of the page
    seam_jump: float  # largest difference of w between both sides of these, as bilinear lookups see it
    seam_jump_before: float  # before they were closed


@dataclass(frozen=True, eq=False)
class BakedTexture(Columns):
    """Pages of h rows, the uppermost (v = 1) first, and w columns of texels; the whole page is filled.

    Attributes:
        w: float32 (h, w), mean obscurance over what each texel shows, in [0, 1]; 1 is open.
        error: float32 (h, w), estimated standard error of w; 0 beside the charts.
        bent_normals: float32 (h, w, 3), unit mean direction of what is open, in the mesh's space or in tangent space.
        covered: bool (h, w), the texels that were baked; the rest is padding.
        rays: number of rays traced, by an interrupted run too.
        rays_skipped: number of rays not traced, by reason.
        rmse: estimated root mean square of `error` over the covered texels.
        facts: of the texture coordinates and seams.
        uv: float64 (m, 3, 2), the texture coordinates that it is for, NaN of faces that are not on the page.
        seconds, mu, mesh, shortfalls, calibration: as `ao.Bake` has them.
        others, rmses, profile, profile_errors: see `ao.result.Columns`.
    """

    w: Float32s
    error: Float32s
    bent_normals: Float32s
    covered: Bools
    rays: int
    rays_skipped: dict[str, int]
    rmse: float
    facts: TextureFacts
    uv: Float64s
    seconds: dict[str, float] = field(compare=False)
    mu: Mu
    mesh: Mesh
    shortfalls: tuple[str, ...] = ()
    calibration: Calibration | None = None

    def __repr__(self) -> str:
        height, width = self.w.shape
        range_ = f"w from {self.w.min():.3f} to {self.w.max():.3f}"
        return f"<BakedTexture {width}×{height}: {range_}, RMSE {self.rmse:.2g}, {self.rays:,} rays>"

    def _repr_png_(self) -> bytes:
        """w as a PNG of greys without a colour space: what notebooks show."""
        return linear_png((255 * self.w[..., None] + 0.5).astype(np.uint8))


def assemble_pages(
    layout: UVLayout,
    texels: Texels,
    seams: Seams,
    close: bool,
    threads: int,
    rows: Float64s,
    variance: Float64s,
    frames: Float64s | None = None,
) -> tuple[tuple[Float32s, Float32s, Float32s, Bools], tuple[float, float]]:
    """Spread estimates of texels over the page, close seams, and fill the rest of it.

    Args: rows: (k, 4), w and the mean of μ·direction. variance: (k,), of w. frames: (k, 3, 3), of bent normals.
    Returns: `BakedTexture.w`, `error`, `bent_normals`, `covered`; the largest jumps at seams, as they are and before.
    """
    shape = layout.height, layout.width
    covered = np.zeros(shape, np.bool_)
    w, error, bent = np.zeros(shape), np.zeros(shape, np.float32), np.zeros((*shape, 3), np.float32)
    axes = texels.first_points.normals

    def spread(first: int, last: int) -> None:
        block = slice(first, last)
        at, mean = texels.texels[block], rows[block, 1:]
        covered.ravel()[at], w.ravel()[at] = True, rows[block, 0].clip(0.0, 1.0)
        error.ravel()[at] = np.sqrt(variance[block])
        clear = np.einsum("ij,ij->i", mean, mean) > 1e-18
        directions = np.where(clear[:, None], normalize(mean), axes[block])
        if frames is not None:
            directions = np.einsum("kij,kj->ki", frames[block], directions)
        bent.reshape(-1, 3)[at] = directions

    run_blocks(len(texels), _BLOCK, spread, threads, most=_SHARE)
    beside = np.zeros(shape, np.bool_)
    run_blocks(layout.height, _ROWS, bind(_extend, w, covered, layout.wraps, beside), threads)
    known = covered | beside
    seams = seams.within(known.ravel())
    before = seams.jump(w.ravel())
    if close:
        w = seams.close(w.ravel(), covered.ravel(), threads).reshape(shape)
    else:
        known = covered
    page = fill_holes(w.astype(np.float32)[:, :, None], known, threads)[:, :, 0].clip(0.0, 1.0)
    whole = normalize(fill_holes(bent, covered, threads).astype(np.float64)).astype(np.float32)
    return (page, error, whole, covered), (seams.jump(page.ravel().astype(np.float64)), before)


@kernel
def _extend(page, covered, wraps, beside, first, last):
    """Give texels of some rows next to covered ones the covered neighbours' mean, in place, and mark them `beside`."""
    height, width = page.shape
    for row in range(first, last):
        for column in range(width):
            if covered[row, column]:
                continue
            total, count = 0.0, 0
            for k in range(9):
                y, x = row + 1 - k // 3, column + 1 - k % 3
                if wraps:
                    y, x = y % height, x % width
                elif y < 0 or x < 0 or y >= height or x >= width:
                    continue
                if covered[y, x]:
                    total, count = total + page[y, x], count + 1
            if count:
                page[row, column], beside[row, column] = total / count, True
