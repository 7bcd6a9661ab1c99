"""Directional albedo (the white furnace test) and reciprocity of any material, measured."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial.legendre import leggauss

from ..types import Float64s
from .base import BaseMaterial
from .reflect import reflect

NORMAL = np.array([0.0, 0.0, 1.0])
_gauss_legendre = cache(leggauss)  # an eigenvalue problem, for every angle of a table


def towards(theta: npt.ArrayLike, phi: npt.ArrayLike = 0.0) -> Float64s:
    """Unit vectors (…, 3) at angle theta from the z axis and azimuth phi, radians."""
    sine = np.sin(theta)
    return np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)), axis=-1)


def directional_albedo(
    material: BaseMaterial, incidence: float, slope: float | None = None, order: int = 96
) -> Float64s:
    """∫ f cosθ_r dω (3,): the part of light arriving at `incidence` radians that is reflected (the white furnace).

    Gauss–Legendre in angle, trapezoids in azimuth. Diffuse materials are integrated over viewers; a lobe of RMS `slope`
    over halfway vectors to six slopes, dω_v = 4 (l·h) dω_h, since over viewers it would be missed.
    """
    l = towards(incidence)
    nodes, weights = _gauss_legendre(order)
    end = np.pi / 2 if slope is None else min(np.pi / 2, float(np.arctan(6 * slope)))
    theta = (0.5 * end * (nodes + 1))[:, None]
    phi = (np.arange(2 * order) + 0.1) * np.pi / order
    solid = np.broadcast_to(0.5 * end * weights[:, None] * np.sin(theta) * np.pi / order, (order, 2 * order))
    v = towards(theta, phi)
    if slope is not None:
        lh = v @ l
        v, solid = 2 * lh[..., None] * v - l, solid * 4 * np.maximum(0, lh)
    above = v[..., 2:] > 0
    out = reflect(material, NORMAL, l, np.where(above, v, NORMAL)) / l[2]
    return np.asarray(np.sum(np.where(above, out * v[..., 2:], 0) * solid[..., None], axis=(0, 1)))


def albedo(material: BaseMaterial, incidence: float, order: int = 96) -> Float64s:
    """`directional_albedo` (3,) of any material: its body integrated over viewers, its lobe over halfway vectors."""
    broad, slope = directional_albedo(material, incidence, order=order), material.lobe_slope()
    if slope is None:
        return broad
    body: dict[str, Any] = {name: 0.0 for name in ("albedo", "k_d") if hasattr(material, name)}
    lobe = replace(material, **body)
    return broad - directional_albedo(lobe, incidence, order=order) + directional_albedo(lobe, incidence, slope, order)


def asymmetry(material: BaseMaterial, count: int = 20_000, seed: int = 0) -> float:
    """Largest |f(l,v) − f(v,l)| / max over random pairs of directions; 0 for a reciprocal material, at most 1."""
    rng = np.random.default_rng(seed)
    l, v = rng.normal(size=(2, count, 3))
    for w in (l, v):
        w[:, 2] = np.abs(w[:, 2])
        w /= np.linalg.norm(w, axis=1)[:, None]
    there, back = reflect(material, NORMAL, l, v) / l[:, 2:], reflect(material, NORMAL, v, l) / v[:, 2:]
    size = np.maximum(there, back)
    usable = size > 1e-12
    return float(np.max(np.abs(there - back)[usable] / size[usable], initial=0.0))
