"""Numbers in text, for kernels: rounded correctly, as Python's `float` does, or left to the caller.

The product or quotient of two numbers that doubles hold exactly is rounded correctly (Clinger 1990, "How to read
floating point numbers accurately"). Up to 19 digits and 10^±60 it is formed of pairs of doubles (Dekker 1971) and taken
where their error cannot change how it is rounded (Ziv 1991).
"""

import numpy as np

from ..kernel.jit import inline

POWERS = np.array([[float(10**k), float(10**k - int(float(10**k)))] for k in range(61)])
"""Powers of ten and what their rounding leaves, (61, 2), for `parse_float`."""
_DIGITS = 19  # below 2⁶⁴, whatever they are
_EXACT, _EXACT_POWER = np.uint64(1 << 53), 22
_SPLIT = 134217729.0  # 2²⁷ + 1


@inline
def byte(text, i):
    """text[i], i ≥ 0: Numba takes twice as long where an index may be negative."""
    return text[np.uint64(i)]


@inline
def is_blank(c):
    return c == 32 or 9 <= c <= 13


@inline
def is_digit(c):
    return 48 <= c <= 57


@inline
def parse_float(text, i, powers):
    """The number at text[i]: (number, where it ends, whether it is one that this can round).

    Args: text: bytes, one of them after the number that cannot be part of one. powers: `POWERS`.
    """
    sign = byte(text, i)
    if sign == 45 or sign == 43:
        i += 1
    mantissa, digits, exponent, valid, point = np.uint64(0), 0, 0, False, False
    while is_digit(byte(text, i)) or (byte(text, i) == 46 and not point):
        c = byte(text, i)
        if c == 46:
            point = True
        else:
            mantissa = mantissa * np.uint64(10) + np.uint64(c - 48)
            digits += digits > 0 or c > 48
            exponent -= point
            valid = True
        i += 1
    if valid and (byte(text, i) == 101 or byte(text, i) == 69):
        down, scale, valid = byte(text, i + 1) == 45, 0, False
        i += 2 if down or byte(text, i + 1) == 43 else 1
        while is_digit(byte(text, i)):
            scale = 10 * scale + byte(text, i) - 48 if scale < 1000 else scale
            valid = True
            i += 1
        exponent += -scale if down else scale
    value, sure = _round(mantissa, exponent, powers)
    return -value if sign == 45 else value, i, valid and digits <= _DIGITS and sure


@inline
def _round(mantissa, exponent, powers):
    """mantissa·10^exponent, and whether it is correctly rounded."""
    power = abs(exponent)
    if mantissa == 0 or power >= len(powers):
        return 0.0, mantissa == 0
    a, p, q = np.float64(mantissa), powers[power, 0], powers[power, 1]
    if mantissa <= _EXACT and power <= _EXACT_POWER:
        return a / p if exponent < 0 else a * p, True
    rest = np.float64(np.int64(mantissa - np.uint64(a)))
    if exponent < 0:
        high = a / p
        product, error = _multiply(high, p)
        low = (a - product - error + rest - high * q) / p
    else:
        high, error = _multiply(a, p)
        low = error + (rest * p + a * q)
    slack = abs(low) * 2.0**-48 + high * 2.0**-100
    return high + low, high + (low - slack) == high + (low + slack)


@inline
def _multiply(a, b):
    """a·b rounded, and what that leaves (Dekker 1971)."""
    product = a * b
    x, y = a * _SPLIT, b * _SPLIT
    x, y = x - (x - a), y - (y - b)
    return product, ((x * y - product) + x * (b - y) + (a - x) * y) + (a - x) * (b - y)
