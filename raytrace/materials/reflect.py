"""Reflection of a material over arrays of directions."""

from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import OptionError, check_type
from ..types import AnyFloats
from .materials import BaseMaterial


def reflect(
    material: BaseMaterial, n: npt.ArrayLike, l: npt.ArrayLike, v: npt.ArrayLike, grain: npt.ArrayLike | None = None
) -> AnyFloats:
    """Reflected RGB per unit incident RGB.

    For physical models (`material.physical`) this is BRDF·(n·l), in 1/sr; for Phong, Blinn–Phong, Strauss and
    Poulin–Fournier it is the model's own dimensionless k_d⟨n·l⟩ + k_s S. Emission and ambient light are not in it: see
    `material.emission` and `raytrace.brdf.layout.AMBIENT`.

    Args:
        material: any material of `raytrace.materials`.
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
    from ..brdf.dispatch import reflect_rows
    from ..mesh.normals import normalize

    arrays = {"n": _vectors("n", n), "l": _vectors("l", l), "v": _vectors("v", v)}
    arrays["grain"] = np.zeros(3, arrays["n"].dtype) if grain is None else _vectors("grain", grain)
    given = list(arrays.values())
    single = all(a.dtype == np.float32 for a in given)
    try:
        shape = np.broadcast_shapes(*(a.shape for a in given))
    except ValueError:
        got = ", ".join(f"{name} {a.shape}" for name, a in arrays.items())
        raise OptionError("n, l, v, grain", "shapes that broadcast", got, "reflect") from None
    flat = [np.ascontiguousarray(np.broadcast_to(normalize(a), shape)).reshape(-1, 3) for a in given]
    check_type(material, BaseMaterial, "reflect", "material", "a material, such as raytrace.Lambert(albedo=0.5)")
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
    finite = np.isfinite(array).all(axis=-1)
    if not finite.all():
        first = array[~finite][0]
        raise OptionError(name, "finite numbers", f"{first} ({np.count_nonzero(~finite)} such)", "reflect")
    return array
