"""Reflection of a material over arrays of directions; directional albedo (the white furnace test) and reciprocity."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial.legendre import leggauss

from ..errors import OptionError, check_type
from ..types import AnyFloats, Float64s
from .material import Material

NORMAL = np.array([0.0, 0.0, 1.0])
_gauss_legendre = cache(leggauss)  # an eigenvalue problem, for every angle of a table


def reflect(
    material: Material, n: npt.ArrayLike, l: npt.ArrayLike, v: npt.ArrayLike, grain: npt.ArrayLike | None = None
) -> AnyFloats:
    """Reflected RGB per unit incident RGB.

    For physical models (`material.physical`) this is BRDF·(n·l), in 1/sr; for Phong, Blinn–Phong, Strauss and
    Poulin–Fournier it is the model's own dimensionless k_d⟨n·l⟩ + k_s S. Emission and ambient light are not in it: see
    `material.emission` and `raytrace.brdf.material.AMBIENT`.

    Args:
        material: any material of `raytrace.brdf.models`.
        n, l, v: normals, directions to the light, directions to the viewer: (…, 3), broadcast against each other,
            pointing away from the surface. They are normalised here; a zero vector reflects nothing.
        grain: tangents of the surface (…, 3), along which an anisotropic material is brushed that has no grain of its
            own.

    Returns:
        (…, 3), float32 if every array given is float32, else float64; never negative, zero where n·l ≤ 0. A viewer
        below the surface sees no microfacets and no cylinders; diffuse terms do not ask where the viewer is.

    Raises:
        OptionError: an array is not of finite numbers, not (…, 3), or does not broadcast with the others.
    """
    from ..mesh.normals import normalize
    from .dispatch import reflect_rows

    arrays = {"n": _vectors("n", n), "l": _vectors("l", l), "v": _vectors("v", v)}
    arrays["grain"] = np.zeros(3, arrays["n"].dtype) if grain is None else _vectors("grain", grain)
    vectors = list(arrays.values())
    single = all(a.dtype == np.float32 for a in vectors)
    try:
        shape = np.broadcast_shapes(*(a.shape for a in vectors))
    except ValueError:
        got = ", ".join(f"{name} {a.shape}" for name, a in arrays.items())
        raise OptionError("n, l, v, grain", "shapes that broadcast", got, "reflect") from None
    # Unit vectors as rows, and the packed material.
    flat = [np.ascontiguousarray(np.broadcast_to(normalize(a), shape)).reshape(-1, 3) for a in vectors]
    check_type(material, Material, "reflect", "material", "a material, such as raytrace.Lambert(albedo=0.5)")
    kind, row = material.pack()
    out = np.empty_like(flat[0])
    normals, lights, viewers, grains = flat
    reflect_rows(kind, row, normals, lights, viewers, grains, out)
    return out.reshape(shape).astype(np.float32 if single else np.float64)


def _vectors(name: str, values: npt.ArrayLike) -> npt.NDArray[Any]:
    """`values` as an array (…, 3) of finite real numbers. Raises: OptionError naming the argument."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise OptionError(name, "an array of shape (…, 3)", "rows of different lengths", "reflect") from None
    if array.dtype.kind not in "fiub":
        raise OptionError(name, "real numbers", array.dtype, "reflect")
    if array.ndim == 0 or array.shape[-1] != 3:
        raise OptionError(name, "an array of shape (…, 3)", f"shape {array.shape}", "reflect")
    bad = array[~np.isfinite(array).all(axis=-1)]
    if len(bad):
        raise OptionError(name, "finite numbers", f"{bad[0]} ({len(bad)} such)", "reflect")
    return array


def towards(theta: npt.ArrayLike, phi: npt.ArrayLike = 0.0) -> Float64s:
    """Unit vectors (…, 3) at angle theta from the z axis and azimuth phi, radians."""
    sine = np.sin(theta)
    return np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)), axis=-1)


def directional_albedo(material: Material, incidence: float, slope: float | None = None, order: int = 96) -> Float64s:
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
        v = 2 * lh[..., None] * v - l
        solid = solid * 4 * np.maximum(0, lh)
    above = v[..., 2:] > 0
    out = reflect(material, NORMAL, l, np.where(above, v, NORMAL)) / l[2]
    return np.asarray(np.sum(np.where(above, out * v[..., 2:], 0) * solid[..., None], axis=(0, 1)))


def albedo(material: Material, incidence: float, order: int = 96) -> Float64s:
    """`directional_albedo` (3,) of any material: its body integrated over viewers, its lobe over halfway vectors."""
    broad = directional_albedo(material, incidence, order=order)
    slope = material.lobe_slope()
    if slope is None:
        return broad
    body: dict[str, Any] = {name: 0.0 for name in ("albedo", "k_d") if hasattr(material, name)}
    lobe = replace(material, **body)
    return broad - directional_albedo(lobe, incidence, order=order) + directional_albedo(lobe, incidence, slope, order)


def asymmetry(material: Material, count: int = 20_000, seed: int = 0) -> float:
    """Largest |f(l,v) − f(v,l)| / max over random pairs of directions; 0 for a reciprocal material, at most 1."""
    rng = np.random.default_rng(seed)
    l, v = rng.normal(size=(2, count, 3))
    for w in (l, v):
        w[:, 2] = np.abs(w[:, 2])
        w /= np.linalg.norm(w, axis=1)[:, None]
    there = reflect(material, NORMAL, l, v) / l[:, 2:]
    back = reflect(material, NORMAL, v, l) / v[:, 2:]
    size = np.maximum(there, back)
    usable = size > 1e-12
    return float(np.max(np.abs(there - back)[usable] / size[usable], initial=0.0))
