"""`reflect`: what a material reflects, over arrays of directions."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import check_type
from raytrace.materials import BaseMaterial


def reflect(
    material: BaseMaterial,
    n: npt.ArrayLike,
    l: npt.ArrayLike,
    v: npt.ArrayLike,
    grain: npt.ArrayLike | None = None,
) -> npt.NDArray[np.floating[Any]]:
    """Reflected RGB per unit incident RGB.

    For physical models (Lambert, Oren–Nayar, Cook–Torrance, elliptical Beckmann) this is BRDF·(n·l), in 1/sr; for
    Phong, Blinn–Phong, Strauss and Poulin–Fournier it is the model's own dimensionless k_d⟨n·l⟩ + k_s S. Emission and
    ambient light are not in it: see `material.emission` and `raytrace.models.dispatch.ambient`.

    Args:
        material: any material of `raytrace.materials`.
        n, l, v: normals, directions to the light, directions to the viewer: (…, 3), broadcast against each other,
            pointing away from the surface. They are normalised here; a zero vector reflects nothing.
        grain: tangents (…, 3) along which an anisotropic surface is brushed; default: the material's own grain.

    Returns: (…, 3), float32 if every array given is float32, else float64; never negative, zero where n·l ≤ 0. A viewer
        below the surface sees no microfacets and no cylinders; diffuse terms do not ask where the viewer is.
    """
    from raytrace.models.array import reflect_rows
    from raytrace.normals import normalize

    given = [np.asarray(a) for a in (n, l, v, np.zeros(3, np.asarray(n).dtype) if grain is None else grain)]
    single = all(a.dtype == np.float32 for a in given)
    shape = np.broadcast_shapes(*(a.shape for a in given))
    flat = [np.ascontiguousarray(np.broadcast_to(normalize(a), shape)).reshape(-1, 3) for a in given]
    check_type(material, BaseMaterial, "reflect", "material", "a material, such as raytrace.Lambert(albedo=0.5)")
    kind, row = material.pack()
    out = np.empty_like(flat[0])
    normals, lights, viewers, grains = flat
    reflect_rows(kind, row, normals, lights, viewers, grains, out)
    return out.reshape(shape).astype(np.float32 if single else np.float64)
