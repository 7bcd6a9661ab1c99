"""Dispatch over the reflection models by a material's kind, for kernels that meet many materials.

    red, green, blue = evaluate(kind, row, n, l, v, tangent)

`kind` and `row` come from a material's `pack()`; directions are triples of unit vectors pointing away from the surface.
The result is the reflected RGB for unit incident RGB: BRDF·(n·l) for physical models, k_d⟨n·l⟩ + k_s S for Phong-type
ones; zero, everywhere, for a light at or below the horizon. A material without a grain of its own is brushed along the
surface's `tangent`.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..kernel.jit import Late, inline, kernel
from ..kernel.simd import WIDE, pick, replace
from ..kernel.vector import add, choose, dot, load, scale, triple
from ..types import Float64Rows, Float64s
from .material import GRAIN, TO_LIGHT, TO_VIEWER, TWO_SIDED
from .registry import in_lanes, reflection_models


@inline
def _black(kind, row, n, l, v, grain, wanted):
    """Black, for kinds that no model has: the end of the chain that `_dispatcher` builds."""
    return scale(0.0, n), scale(0.0, n)


def _branch_on_kind(model_kind: int, terms: Any, otherwise: Any) -> Any:
    """A helper that calls `terms` for materials of the kind `model_kind`, and `otherwise` for all others."""

    @inline
    def chosen(kind, row, n, l, v, grain, wanted):
        if kind == model_kind:
            return terms(row, n, l, v, grain, wanted)
        return otherwise(kind, row, n, l, v, grain, wanted)

    return chosen


def _dispatcher(terms_by_kind: Iterable[tuple[int, Any]]) -> Any:
    """A helper that compares its first argument, a kind, with those of `terms_by_kind` and calls that model's terms."""
    chosen = _black
    for kind, terms in terms_by_kind:
        chosen = _branch_on_kind(kind, terms, chosen)
    return chosen


def _lane_by_lane(terms: Any) -> Any:
    """`terms_in_lanes` of a model that is written for scalars only: its `terms`, called for one lane after another."""

    @inline
    def each_lane(row, n, l, v, grain, wanted):
        zero = scale(0.0, n)
        diffuse, specular = zero, zero
        for lane in range(WIDE):
            if pick(wanted, lane):
                normal = _lane(n, lane)
                light = _lane(l, lane)
                if dot(normal, light) > 0.0:
                    d, s = terms(row, normal, light, _lane(v, lane), _lane(grain, lane))
                    diffuse = _replaced(diffuse, lane, d)
                    specular = _replaced(specular, lane, s)
        return diffuse, specular

    return each_lane


@inline
def _lane(a, lane):
    """One lane of a triple of lanes, as a triple of float64 scalars."""
    return (np.float64(pick(a[0], lane)), np.float64(pick(a[1], lane)), np.float64(pick(a[2], lane)))


@inline
def _replaced(a, lane, b):
    """The triple of lanes `a` with the triple of scalars `b` in one lane."""
    return (replace(a[0], lane, b[0]), replace(a[1], lane, b[1]), replace(a[2], lane, b[2]))


_terms_of: Any = Late(lambda: _dispatcher((model.kind, in_lanes(model.terms)) for model in reflection_models()))
_terms_in_lanes_of: Any = Late(
    lambda: _dispatcher(
        (model.kind, model.terms_in_lanes or _lane_by_lane(model.terms)) for model in reflection_models()
    )
)


@inline
def facing(row, n, l, v):
    """The normal of the side that reflects: n, or −n where a two-sided material turns it to the light or the viewer."""
    side = row[TWO_SIDED]
    turned = (side == TO_LIGHT and dot(n, l) < 0.0) or (side == TO_VIEWER and dot(n, v) < 0.0)
    return scale(-1.0 if turned else 1.0, n)


@inline
def brushed_along(row, tangent):
    """The material's own grain, or the surface's tangent if it has none."""
    grain = triple(row, GRAIN)
    return choose(dot(grain, grain) > 0.0, grain, tangent)


@inline
def terms(kind, row, n, l, v, tangent):
    """Diffuse and specular RGB reflected per unit incident RGB by the side that n points away from."""
    if dot(n, l) <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return _terms_of(kind, row, n, l, v, brushed_along(row, tangent), True)


@inline
def terms_in_lanes(kind, row, n, l, v, tangent, wanted):
    """`terms` in lanes, of float32, for n·l > 0; garbage in lanes where the mask `wanted` is not set."""
    return _terms_in_lanes_of(kind, row, n, l, v, brushed_along(row, tangent), wanted)


@inline
def evaluate(kind, row, n, l, v, tangent):
    """Reflected RGB per unit incident RGB: the sum of `terms` of the side that reflects."""
    diffuse, specular = terms(kind, row, facing(row, n, l, v), l, v, tangent)
    return add(diffuse, specular)


@kernel
def reflect_rows(
    kind: int, row: Float64s, n: Float64Rows, l: Float64Rows, v: Float64Rows, tangent: Float64Rows, out: Float64Rows
) -> None:
    """Fill `out` (k, 3) with the reflected RGB of one packed material for unit vectors n, l, v, tangent (k, 3)."""
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2] = evaluate(kind, row, load(n, i), load(l, i), load(v, i), load(tangent, i))
