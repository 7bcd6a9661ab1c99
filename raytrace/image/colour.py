"""Colour encoding: the sRGB transfer (IEC 61966-2-1), codes of picture files, and rounding to them without bands."""

from typing import Any

import numpy as np
import numpy.typing as npt

from ..types import Float32s, UInt8s

_EXACT = 1 / 1024  # of a step, by which a value may miss a code that it becomes everywhere


def encode_srgb(linear: npt.ArrayLike) -> Float32s:
    """sRGB values in [0, 1] of linear ones, clipped to [0, 1]."""
    x = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055).astype(np.float32)


def decode_srgb(encoded: npt.ArrayLike) -> Float32s:
    """Linear values of sRGB ones in [0, 1]; the inverse of `encode_srgb`."""
    x = np.asarray(encoded, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.04045) + 0.055) / 1.055) ** 2.4).astype(np.float32)


def stored_type(spec: Any) -> str:
    """The dtype that a file is read as: uint8 or uint16 codes, or float32."""
    text = str(spec.format)
    return text if text in ("uint8", "uint16") else "float32"


def decoding_table(spec: Any, srgb: bool | None = None) -> Float32s | None:
    """Linear values of the 8- or 16-bit codes of a file, None for floats.

    Args: srgb: how codes are encoded; None: as the file says.
    """
    codes = stored_type(spec)
    if codes == "float32":
        return None
    values = np.linspace(0.0, 1.0, 256 if codes == "uint8" else 65536)
    if srgb is None:
        srgb = not spec.get_string_attribute("oiio:ColorSpace").startswith("lin")
    return decode_srgb(values) if srgb else values.astype(np.float32)


def rgb_codes(codes: npt.NDArray[Any]) -> UInt8s:
    """Codes (h, w, 1 to 4), or fractions, as RGB of 8 bits (h, w, 3), without alpha."""
    largest = np.iinfo(codes.dtype).max if codes.dtype.kind == "u" else 1.0
    colours = np.broadcast_to(codes[..., : 3 if codes.shape[2] > 2 else 1], (*codes.shape[:2], 3))
    return np.rint(colours * (255 / largest)).astype(np.uint8)


def dithered(values: Float32s, left: int = 0, top: int = 0) -> UInt8s:
    """Codes from 0 to 255 of values in [0, 1], (h, w, c), rounded up at as many pixels as their fraction says.

    Thresholds are interleaved gradient noise, even over 3×3 pixels, the same in all channels (Jimenez 2014, "Next
    Generation Post Processing in Call of Duty: Advanced Warfare"). What is a code stays that code.

    Args: left, top: numbers of the first column and row: a part of a picture has the pixels of the whole.
    """
    height, width = values.shape[:2]
    row_numbers = np.arange(top, top + height)[:, None]
    columns = np.arange(left, left + width)
    noise = np.mod(52.9829189 * np.mod(0.06711056 * columns + 0.00583715 * row_numbers, 1.0), 1.0)
    threshold = _EXACT + (1.0 - 2.0 * _EXACT) * noise
    return np.floor(255.0 * values + threshold[..., None]).astype(np.uint8)
