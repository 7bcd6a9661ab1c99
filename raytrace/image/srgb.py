"""The sRGB transfer between linear light and the values picture files hold (IEC 61966-2-1)."""

import numpy as np
import numpy.typing as npt

from ..types import Float32s


def encode_srgb(linear: npt.ArrayLike) -> Float32s:
    """sRGB values in [0, 1] of linear ones, clipped to [0, 1]."""
    x = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055).astype(np.float32)


def decode_srgb(encoded: npt.ArrayLike) -> Float32s:
    """Linear values of sRGB ones in [0, 1]; the inverse of `encode_srgb`."""
    x = np.asarray(encoded, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.04045) + 0.055) / 1.055) ** 2.4).astype(np.float32)
