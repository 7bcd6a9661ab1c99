"""The result of a bake, assembled from what either method finds at points."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.kernel.vector import dot, load, store
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import normalized
from obscurance.raytrace.mesh.solids import inward_warnings
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import AnyFloats, Float32Rows, Float32s, Float64Rows, Float64s, Int32s, Int64s, UInt8s

from .estimate.calibration import Calibration
from .estimate.inside import holes
from .estimate.rounds import Estimate
from .mu import Mu
from .options import OCTAVES, Options
from .points.receivers import Flag
from .prepared import Prepared

if TYPE_CHECKING:
    from .profile import Profile

VISIBLE = 0.05  # 2.5 of 100 in the lightness of greys, which is noticed beside the right value
_REASONS = "duplicate", "no_normal", "not_wanted", "below_face", "predicted", "hidden"


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


class SquaredError(NamedTuple):
    """The mean squared error of values, and its standard error."""

    mean: float
    deviation: float

    @classmethod
    def of(cls, values: Float64s, estimates: Float64s, variance: Float64s | float = 0.0) -> Self:
        """Of values (k,) with a `variance`, from two independent estimates (k, 2) of what they should be.

        For estimates a, b the mean of (v − a)(v − b) is the squared error of v, whatever their noise.
        """
        squared = (values - estimates[:, 0]) * (values - estimates[:, 1]) - variance
        return cls(float(squared.mean()), float(squared.std()) / len(squared) ** 0.5)

    @property
    def rmse(self) -> float:
        """The root of the mean, 0 where noise has it below."""
        return math.sqrt(max(self.mean, 0.0))

    @property
    def at_least(self) -> float:
        """The root of the mean less two standard errors."""
        return math.sqrt(max(self.mean - 2 * self.deviation, 0.0))


class Interpolation(NamedTuple):
    """The error of w interpolated between vertices, at k points spread evenly over the faces."""

    rmse: float  # over the surface, without the noise of either
    at_least: float  # the same less two standard errors
    faces: Int64s  # (k,), the mesh's, that the points are on
    weights: Float64s  # (k, 3), barycentric
    estimates: Float64s  # (k, 2), two independent ones of w at each point
    best: float = 0.0  # the least that any values at vertices leave, if visible; 0 where points are too few to tell

    @property
    def visible(self) -> bool:
        """Whether the error is surely more than .05, so that shadows lack, or faces are dark all over."""
        return self.at_least > VISIBLE

    @classmethod
    def of(
        cls, faces: Int64s, weights: Float64s, estimates: Float64s, values: Float64s, variance: Float64s
    ) -> Interpolation:
        """The error of interpolated `values` (k,) with a `variance` (k,)."""
        squared = SquaredError.of(values, estimates, variance)
        return cls(squared.rmse, squared.at_least, faces, weights, estimates)


NOWHERE = Interpolation(0.0, 0.0, np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 2)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Columns:
    """Further columns of a bake by several falloffs, or with a profile; see `Bake`."""

    others: tuple[AnyFloats, AnyFloats] | None = None  # w and its error (…, k − 1) by every falloff but the first
    rmses: tuple[float, ...] = ()
    profile: Profile | None = None
    profile_errors: Float32s | None = None

    if TYPE_CHECKING:
        w: AnyFloats
        error: AnyFloats

    @property
    def values(self) -> AnyFloats:
        """w (…, k) by each of k falloffs."""
        return np.concatenate([self.w[..., None], *(self.others or ())[:1]], axis=-1)

    @property
    def errors(self) -> AnyFloats:
        """The standard errors (…, k) of `values`."""
        return np.concatenate([self.error[..., None], *(self.others or ())[1:]], axis=-1)

    def save(self, path: str | os.PathLike[str], mesh_file: Any = None, **options: Any) -> None:
        """Write the result in the format of the ending, with what is baked, as `scenes.write` does.

        Args:
            path: the target, replaced if it exists, whole or not at all.
            mesh_file: the file that the mesh was loaded from, `scenes.load(…)` or its path, to keep what else it holds.
            options: of `scenes.write`.

        Raises: OptionError: no package that writes files is installed. Others as `scenes.write`.
        """
        write = _first_entry_point("obscurance.save")
        if write is None:
            raise OptionError("save", "the package obscurance, installed", "its folders alone: use scenes.write")
        write(path, self, mesh_file, **options)


@dataclass(frozen=True, eq=False)
class Bake(Columns):
    """One row a vertex, in the mesh's own order; of a bake at faces one a face, where it says vertex and vertices.

    Attributes:
        w: float64 (n,), obscurance in [0, 1]; 1 is open. Vertices without a usable normal get 1.
        error: float64 (n,), estimated standard error of w; by the surface method, of the fitted values: their distance
            from the fit to infinitely many samples, not from w at the vertex.
        bent_normals: float64 (n, 3), unit mean direction of what is open; the normal where nothing is, 0 where none.
        flags: uint8 (n,), bits of `ao.Flag`.
        rays: number of rays traced, by an interrupted run too.
        rays_skipped: number of rays not traced, by reason.
        rmse: estimated root mean square of `error` over the vertices asked for; by the surface method over those in
            sight, as of the values inside of other parts nothing is seen.
        seconds: `build` (the hierarchy over the faces) and `bake` (everything else that makes w).
        mu: the falloff used, in mesh units.
        mesh: what was baked.
        shortfalls: what the result lacks of what was asked for, in words: a tolerance that is not met.
        calibration: of the squared errors, at vertices that were baked twice; None by the surface method.
        at: what rows are of, "vertices", "faces" or "points". below: of backs, where asked for; `rays` are of both.
        measure_between: traces what `interpolation` is, when that is first asked for.
        values, errors: float64 (n, k), w and its standard error by each of k falloffs, of which `w` is the first.
        profile: w at half-distances an octave apart, (n, 10); None where it was not asked for. profile_errors: float32
            (n, 10), its standard errors. rmses: of the columns of `errors`, then of `profile_errors`.
    """

    w: Float64s
    error: Float64s
    bent_normals: Float64s
    flags: UInt8s
    rays: int
    rays_skipped: dict[str, int]
    rmse: float
    seconds: dict[str, float] = field(compare=False)
    mu: Mu
    mesh: Mesh
    shortfalls: tuple[str, ...] = ()
    calibration: Calibration | None = None
    at: str = "vertices"
    below: Bake | None = None
    measure_between: Callable[[], Interpolation] | None = field(default=None, repr=False)

    @cached_property
    def interpolation(self) -> Interpolation | None:
        """The error between the vertices; None with `high`, and with `only` but without `denoise`."""
        return self.measure_between() if self.measure_between else None

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"interpolation": self.interpolation, "measure_between": None}

    def __repr__(self) -> str:
        range_ = f"w from {self.w.min():.3f} to {self.w.max():.3f}"
        return f"<Bake of {len(self.w):,} {self.at}: {range_}, RMSE {self.rmse:.2g}, {self.rays:,} rays>"

    def _repr_html_(self) -> str | None:
        """HTML for notebooks, by a package with an entry point of the group `obscurance.html`."""
        to_html = _first_entry_point("obscurance.html")
        return to_html(self) if to_html and self.at == "vertices" else None

    def _repr_png_(self) -> bytes | None:
        """A picture for notebooks: w on the mesh as grey, a little lighter where it faces the camera (`Mesh.up`)."""
        if self.at != "vertices":
            return None
        from obscurance.raytrace import (
            AmbientLight,
            Camera,
            DirectionalLight,
            Lambert,
            Object,
            Scene,
            Settings,
            Shape,
            render,
        )
        from obscurance.raytrace.image.colour import decode_srgb

        greys = np.repeat(decode_srgb(self.w)[:, None], 3, axis=1).astype(np.float64)
        shape = Shape(self.mesh, Lambert(albedo=(1, 1, 1), two_sided="viewer"), colours=greys)
        camera = Camera.framing(self.mesh, aspect=4 / 3)
        ahead = DirectionalLight(direction=camera.axes()[2].tolist(), intensity=(0.4 * math.pi,) * 3)
        lights = AmbientLight(intensity=(0.6, 0.6, 0.6)), ahead
        scene = Scene((Object(shape),), lights, background=(0.05, 0.05, 0.05))
        return render(scene, camera, Settings(width=480, height=360, samples=4), layers=False)._repr_png_()

    @property
    def coarse(self) -> bool:
        """Whether interpolation between the vertices surely errs by more than .05, which pictures show."""
        return self.interpolation is not None and self.interpolation.visible

    @property
    def flagged(self) -> dict[str, int]:
        """Number of vertices that carry each `Flag`, by its name in lower case."""
        return {flag.name.lower(): int(np.count_nonzero(self.flags & flag)) for flag in Flag if flag.name}


class PointValues(NamedTuple):
    """Values at the k points of `Prepared.requested_receivers`; see `Bake`."""

    w: Float64s
    error: Float64s
    bent: AnyFloats  # (k, 3), mean of μ·direction
    samples: int  # asked for at a point
    rays: int
    rays_skipped: dict[str, int]
    calibration: Calibration | None = None
    others: tuple[Float64s, ...] = ()  # w and its standard error (k, j) by j falloffs more, if there are any
    in_sight: Float64s | None = None  # (k,), by which they count in root mean squares; None: alike

    @classmethod
    def of(cls, columns: Sequence[Estimate], hidden: int, rays: int, displaced: AnyFloats | float = 0.0) -> PointValues:
        """Values at points from the estimates by each falloff, the first being that of w.

        Args:
            hidden: how many are filled. rays: that were traced.
            displaced: (k,), errors besides, of ray origins in folds.
        """
        w = [np.clip(estimate.w, 0.0, 1.0) for estimate in columns]
        error = [np.sqrt(estimate.variance + np.square(displaced)) for estimate in columns]
        further = tuple(np.stack(columns_of[1:], axis=-1) for columns_of in (w, error)) if len(columns) > 1 else ()
        estimate = columns[0]
        return cls(
            w[0],
            error[0],
            estimate.bent,
            estimate.samples,
            rays,
            estimate.skipped(hidden),
            estimate.calibration,
            further,
        )


def rms(values: Float64s, weights: Float64s) -> float:
    """Root mean square of values (k,) by weights (k,), 0 where these are."""
    return float(np.sqrt(weights @ values**2 / max(weights.sum(), 1e-300)))


class BakedElements(NamedTuple):
    """The n vertices or faces that have a row of the result each."""

    point: Int32s | Int64s  # (n,), the row in `PointValues`, −1 for none
    flags: UInt8s  # (n,)
    normals: Float32s  # (k, 3), of the points
    wanted: int  # how many w was asked for at


def baked_vertices(prepared: Prepared, count: int) -> BakedElements:
    """The first `count` vertices of the mesh of `prepared`."""
    only, receivers = prepared.options.only, prepared.requested_receivers
    requested = count if only is None else int(np.count_nonzero(only))
    return BakedElements(receivers.of_vertex[:count], receivers.flags[:count], receivers.points.normals, requested)


def assemble(prepared: Prepared, mesh: Mesh, elements: BakedElements, values: PointValues) -> Bake:
    """Spread values at points over the elements of `mesh` that have them."""
    # w, errors and bent normals of each element, by its point.
    point = elements.point
    flags = elements.flags
    normals = elements.normals
    wanted = elements.wanted
    count = len(point)
    bent = np.zeros((count, 3))
    _bent_normals.on(prepared.threads)(point, np.ascontiguousarray(values.bent), normals, bent)
    error = np.append(values.error, 0.0)[point]  # −1, for no point, is the last row
    spread = [
        np.append(values_of, np.full((1, values_of.shape[1]), outside), axis=0)[point]
        for values_of, outside in zip(values.others, (1.0, 0.0), strict=False)
    ]
    # Root mean squares over the elements asked for, and rays not traced, by reason.
    errors = [error, *(column for table in spread[1:] for column in table.T)]
    rmses = tuple(float(np.sqrt(np.sum(column**2) / max(wanted, 1))) for column in errors)
    if values.in_sight is not None:
        errors = [values.error, *(column for table in values.others[1:] for column in table.T)]
        rmses = tuple(rms(column, values.in_sight) for column in errors)
    elements_skipped = {
        "duplicate": int(np.count_nonzero(point >= 0)) - len(normals),
        "no_normal": int(np.count_nonzero(flags & (Flag.UNREFERENCED | Flag.DEGENERATE))),
        "not_wanted": len(point) - wanted,
    }
    skipped = {name: values.samples * count for name, count in elements_skipped.items()} | values.rays_skipped
    return Bake(
        w=np.append(values.w, 1.0)[point],
        error=error,
        bent_normals=bent,
        flags=flags,
        rays=values.rays,
        rays_skipped={reason: skipped[reason] for reason in _REASONS if reason in skipped},
        rmse=rmses[0],
        rmses=rmses,
        seconds={},
        mu=prepared.mu,
        calibration=values.calibration,
        mesh=mesh,
        at=getattr(prepared.options, "at", "vertices"),
        **of_columns(prepared.options, prepared.mus, spread),
    )


@each("point")
def _bent_normals(
    i: int, point: Int32s | Int64s, bent: Float32Rows | Float64Rows, normals: Float32Rows, out: Float64Rows
) -> None:
    """Write the unit bent normals of elements, their points' normal where the mean open direction cancels."""
    if point[i] >= 0:
        direction = load(bent, point[i])
        clear = dot(direction, direction) > 1e-18
        store(out, i, normalized(direction) if clear else load(normals, point[i]))


def of_columns(options: Options, mus: Sequence[Mu], columns: Sequence[AnyFloats]) -> dict[str, Any]:
    """`Bake.others`, `profile` and `profile_errors` from w and errors (…, j) of the falloffs after the first, if
    any. Args: mus: of all falloffs."""
    if not len(columns):
        return {}
    listed = len(options.falloffs) - 1
    further: dict[str, Any] = {"others": tuple(column[..., :listed] for column in columns)} if listed else {}
    if options.profile:
        lengths = np.array([math.log(2) / (mu.tau or math.inf) for mu in mus[1 + listed :]])
        values, errors = columns
        from .profile import Profile

        kept = values[..., listed:].astype(np.float32)
        further["profile"] = Profile(lengths, kept, lengths[0] / OCTAVES[0], mus[-1].max_distance)
        further["profile_errors"] = errors[..., listed:].astype(np.float32)
    return further


def shortfalls(
    options: Options, rmses: Sequence[float], samples: int, kind: str, solid: Mesh, vertices: Float32s
) -> tuple[str, ...]:
    """The lines about what the result lacks of what was asked for.

    They name a tolerance that a falloff asked for does not meet, also in a warning of Python's, closed parts of the
    `solid` that look inwards, and holes of a `solid` whose thickness is baked.

    Args: rmses: by each falloff, those asked for first. samples: rays of the point that has most. kind: of the points,
        in a word. vertices: of the solid and what else occludes, in render space.
    """
    texts = []
    rmse = max(rmses[: len(options.falloffs)])
    if options.tolerance is not None and rmse > options.tolerance:
        reason = f": {samples:,} rays a {kind} were allowed" if samples >= options.rays else ""
        texts = [f"tolerance {options.tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"]
        warnings.warn(texts[0], ToleranceWarning, stacklevel=5)  # whoever called `ao.bake`
    if options.thickness:
        return (*texts, *holes(solid))
    return (*texts, *inward_warnings(solid, vertices[: len(solid.vertices)]))


def _first_entry_point(group: str) -> Callable[..., Any] | None:
    """The function that a package above offers for results by an entry point of a group, or None."""
    from importlib.metadata import entry_points

    for offer in entry_points(group=group):
        function: Callable[..., Any] = offer.load()
        return function
    return None
