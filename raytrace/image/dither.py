"""Rounding to 8 bits without bands."""

import numpy as np

from ..types import Float32s, UInt8s

_EXACT = 1 / 1024  # of a step, by which a value may miss a code that it becomes everywhere


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
