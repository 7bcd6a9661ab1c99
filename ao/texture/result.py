"""A baked texture, and its pages from estimates at texels: spread, seams closed, the rest filled."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obscurance.raytrace.image.fill import fill_holes
from obscurance.raytrace.image.write import linear_png
from obscurance.raytrace.kernel.vector import dot, load, store
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import normalized
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import BoolRows, Bools, Float32Rows, Float32s, Float64Grid, Float64Rows, Float64s, Int64s

from ..estimate.calibration import Calibration
from ..estimate.rounds import Estimate
from ..mu import Mu
from ..result import Columns
from .texels import Texels
from .uv_layout import UVLayout

if TYPE_CHECKING:
    from .seams import Seams, Shown

_ROWS = 1 << 4  # of the page
_CLEAR = 1e-18  # least square of a mean direction that is one


@dataclass(frozen=True, eq=False)
class TextureFacts:
    """Facts about a layout of texture coordinates: counts of texels and faces, and jumps of w at seams."""

    covered: int  # texels that faces reach into
    overlapping: int  # texels in which faces lie over one another
    hidden: int  # texels that are filled because they lie inside solids
    missed: int  # points that the cage missed
    mirrored: int  # faces that are turned over
    flat: int  # faces that have no area on the page
    outside: int  # faces that reach out of the unit square
    seam_edges: int  # edges that lie at two places of the page
    seam_jump: float  # largest difference of w between both sides of seams, as bilinear lookups see it
    seam_jump_before: float  # before seams were closed


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


class Pages(NamedTuple):
    """`BakedTexture.w`, `error`, `bent_normals` and `covered`; the largest jump at seams, and before closing."""

    w: Float32s
    error: Float32s
    bent_normals: Float32s
    covered: Bools
    jump: float
    jump_before: float


@dataclass(frozen=True, eq=False)
class PageAssembly:
    """What pages are assembled by."""

    layout: UVLayout
    texels: Texels
    seams: Seams
    shown: Shown | None  # None: seams are left open
    threads: int

    def assemble(self, estimate: Estimate, frames: Float64s | None = None) -> Pages:
        """Pages of estimates at the texels (k,). Args: frames: (k, 3, 3), of bent normals."""
        shape = self.layout.height, self.layout.width
        w = np.zeros(shape)
        error = np.zeros(shape, np.float32)
        bent = np.zeros((*shape, 3), np.float32)
        covered = np.zeros(shape, np.bool_)
        values = np.column_stack([estimate.w, estimate.bent]), estimate.variance, self.texels.points.normals
        flat = w.ravel(), error.ravel(), bent.reshape(-1, 3), covered.ravel()
        _spread.on(self.threads)(self.texels.texels, values, frames, flat)
        # Seams closed, and the rest of the page filled from what is covered and what is next to that.
        beside = np.zeros(shape, np.bool_)
        _extend.on(self.threads)(w, covered, self.layout.wraps, beside)
        known = covered | beside
        seams = self.seams.within(known.ravel())
        jump_before = seams.jump(w.ravel())
        if self.shown:
            shown, share = self.shown.lookups(self.layout, covered.ravel())
            w = seams.close(w.ravel(), shown, share, self.threads).reshape(shape)
        page = fill_holes(w.astype(np.float32)[:, :, None], known, self.threads)[:, :, 0].clip(0.0, 1.0)
        jump = seams.jump(page.ravel())
        bent = fill_holes(bent, covered, self.threads)
        _normalize.on(self.threads)(bent.reshape(-1, 3))
        return Pages(page, error, bent, covered, jump, jump_before)


@each("texels")
def _spread(
    i: int,
    texels: Int64s,
    estimated: tuple[Float64Rows, Float64s, Float32Rows],
    frames: Float64Grid | None,
    pages: tuple[Float64s, Float32s, Float32Rows, Bools],
) -> None:
    """Write w, its error and bent normals of texels to flat `pages`.

    Args:
        estimated: rows of estimates, variances, and axes of the hemispheres.
        frames: as of `assemble`.
    """
    values, variance, axes = estimated
    w, error, bent, covered = pages
    to = texels[i]
    covered[to] = True
    w[to] = min(max(values[i, 0], 0.0), 1.0)
    error[to] = np.sqrt(variance[i])
    direction = (values[i, 1], values[i, 2], values[i, 3])
    direction = normalized(direction) if dot(direction, direction) > _CLEAR else load(axes, i)
    if frames is not None:
        frame = frames[i]
        direction = (
            dot(load(frame, 0), direction), dot(load(frame, 1), direction), dot(load(frame, 2), direction)
        )  # fmt: skip
    store(bent, to, direction)


@each("vectors")
def _normalize(i: int, vectors: Float32Rows) -> None:
    """Make vectors unit ones in place."""
    store(vectors, i, normalized(load(vectors, i)))


@each("page", _ROWS)
def _extend(row: int, page: Float64Rows, covered: BoolRows, wraps: bool, beside: BoolRows) -> None:
    """Give texels of some rows next to covered ones the covered neighbours' mean, in place, and mark them `beside`."""
    height, width = page.shape
    for column in range(width):
        if covered[row, column]:
            continue
        total, count = 0.0, 0
        for k in range(9):
            y = row + 1 - k // 3
            x = column + 1 - k % 3
            if wraps:
                y = y % height
                x = x % width
            elif y < 0 or x < 0 or y >= height or x >= width:
                continue
            if covered[y, x]:
                total = total + page[y, x]
                count = count + 1
        if count:
            page[row, column], beside[row, column] = total / count, True
