"""Dispatch over the reflection models by a material's kind, for kernels that meet many materials.

    red, green, blue = evaluate(kind, row, n, l, v, tangent)

`kind` and `row` come from a material's `pack()`; directions are triples of unit vectors pointing away from the surface.
The result is the reflected RGB for unit incident RGB: BRDF·(n·l) for physical models, k_d⟨n·l⟩ + k_s S for Phong-type
ones; zero, everywhere, for a light at or below the horizon. A material without a grain of its own is brushed along the
surface's `tangent`.
"""

import numpy as np

from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, pick, replace
from ..kernel.vector import add, choose, dot, load, scale, triple
from . import ashikhmin_shirley, cook_torrance, kajiya, lambert, oren_nayar, phong, poulin_fournier, strauss, ward
from . import layout as rows

IN_LANES = (rows.LAMBERT, rows.PHONG, rows.BLINN_PHONG, rows.WARD, rows.ASHIKHMIN_SHIRLEY)  # models of scalars or lanes


@inline
def facing(row, n, l, v):
    """The normal of the side that reflects: n, or −n where a two-sided material turns it to the light or the viewer."""
    side = row[rows.TWO_SIDED]
    turned = (side == rows.TO_LIGHT and dot(n, l) < 0.0) or (side == rows.TO_VIEWER and dot(n, v) < 0.0)
    return scale(-1.0 if turned else 1.0, n)


@inline
def terms(kind, row, n, l, v, tangent):
    """Diffuse and specular RGB reflected per unit incident RGB by the side that n points away from."""
    if dot(n, l) <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if kind in IN_LANES:
        return terms_of_either(kind, row, n, l, v, tangent)
    if kind == rows.COOK_TORRANCE:
        return cook_torrance.terms(row, n, l, v)
    if kind == rows.OREN_NAYAR:
        return oren_nayar.terms(row, n, l, v)
    if kind == rows.STRAUSS:
        return strauss.terms(row, n, l, v)
    grain = brushed_along(row, tangent)
    if kind == rows.ELLIPTICAL_BECKMANN:
        return cook_torrance.terms_elliptical(row, n, l, v, grain)
    if kind == rows.KAJIYA:
        return kajiya.terms(row, n, l, v, grain)
    return poulin_fournier.terms(row, n, l, v, grain)


@inline
def brushed_along(row, tangent):
    """The material's own grain, or the surface's tangent if it has none."""
    grain = triple(row, rows.GRAIN)
    return choose(dot(grain, grain) > 0.0, grain, tangent)


@inline
def terms_of_either(kind, row, n, l, v, tangent):
    """`terms` of the models `IN_LANES`, of scalars or in lanes of float32, for n·l > 0."""
    if kind == rows.LAMBERT:
        return lambert.terms(row, n, l)
    if kind == rows.PHONG:
        return phong.terms_phong(row, n, l, v)
    if kind == rows.BLINN_PHONG:
        return phong.terms_blinn(row, n, l, v)
    grain = brushed_along(row, tangent)
    if kind == rows.WARD:
        return ward.terms(row, n, l, v, grain)
    return ashikhmin_shirley.terms(row, n, l, v, grain)


@inline
def terms_wide(kind, row, n, l, v, tangent, wanted):
    """`terms` in lanes, of float32, for n·l > 0; garbage in lanes where the mask `wanted` is not set."""
    if kind in IN_LANES:
        return terms_of_either(kind, row, n, l, v, tangent)
    if kind == rows.KAJIYA:
        return kajiya.terms_wide(row, n, l, v, brushed_along(row, tangent), wanted)
    zero = scale(0.0, n)
    diffuse, specular = zero, zero
    for lane in range(WIDE):
        if pick(wanted, lane):
            d, s = terms(kind, row, _lane(n, lane), _lane(l, lane), _lane(v, lane), _lane(tangent, lane))
            diffuse, specular = _replaced(diffuse, lane, d), _replaced(specular, lane, s)
    return diffuse, specular


@inline
def _lane(a, lane):
    return (np.float64(pick(a[0], lane)), np.float64(pick(a[1], lane)), np.float64(pick(a[2], lane)))


@inline
def _replaced(a, lane, b):
    return (replace(a[0], lane, b[0]), replace(a[1], lane, b[1]), replace(a[2], lane, b[2]))


@inline
def evaluate(kind, row, n, l, v, tangent):
    """Reflected RGB per unit incident RGB: the sum of `terms` of the side that reflects."""
    diffuse, specular = terms(kind, row, facing(row, n, l, v), l, v, tangent)
    return add(diffuse, specular)


@kernel
def reflect_rows(kind, row, n, l, v, tangent, out):
    """Fill `out` (k, 3) with the reflected RGB of one packed material for unit vectors n, l, v, tangent (k, 3)."""
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2] = evaluate(kind, row, load(n, i), load(l, i), load(v, i), load(tangent, i))
