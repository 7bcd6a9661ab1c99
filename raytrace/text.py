"""Lines of numbers, and of a Wavefront OBJ file, for kernels that share its bytes: each takes text[begin:end].

The last byte of `text` must be the end of a line, so that no loop passes it.

Numbers are rounded correctly, as Python's `float` does, or left to the caller. The product or quotient of two numbers
that doubles hold exactly is rounded correctly (Clinger 1990, "How to read floating point numbers accurately"). Up to 19
digits and 10^±60 it is formed of pairs of doubles (Dekker 1971) and taken where their error cannot change how it is
rounded (Ziv 1991).
"""

import numpy as np

from .kernel.jit import inline, kernel
from .types import Float64Rows, Float64s, Int64Rows, Int64s, UInt8s

NUMBERED = "v", "vt", "vn"
V, VT, VN, F, REST, NOTHING = range(6)
"""Kinds of lines: statements of `NUMBERED`, faces, other statements, and comments or blanks."""
NONE = 1 << 62  # the index of a corner that has none
NEEDED = np.array([3, 2, 3, 0])
"""Words that a line of each kind needs."""
COUNT, USABLE, LEAST, MOST, WORDS, SLASHES = range(6)  # columns of a tally
_LARGEST = (1 << 63) - 1
_NAN = np.uint64(0x7FF8 << 48)
_POWERS = np.array([[float(10**k), float(10**k - int(float(10**k)))] for k in range(61)])  # of ten, and their rounding
_DIGITS = 19  # below 2⁶⁴, whatever they are
_EXACT, _EXACT_POWER = np.uint64(1 << 53), 22
_SPLIT = 134217729.0  # 2²⁷ + 1


@inline
def _byte(text, i):
    """text[i], i ≥ 0: Numba takes twice as long where an index may be negative."""
    return text[np.uint64(i)]


@inline
def _is_blank(c):
    """Whether a byte is a blank, a tab or an end of line."""
    return c == 32 or 9 <= c <= 13  # " ", "\t" to "\r"


@inline
def _is_digit(c):
    return 48 <= c <= 57  # "0" to "9"


@inline
def _parse_float(text, i):
    """The number at text[i]: (number, where it ends, whether it is one that this can round)."""
    sign = _byte(text, i)
    if sign == 45 or sign == 43:  # "-", "+"
        i += 1
    mantissa, digits, exponent, valid, point = np.uint64(0), 0, 0, False, False
    while _is_digit(_byte(text, i)) or (_byte(text, i) == 46 and not point):  # "."
        c = _byte(text, i)
        if c == 46:
            point = True
        else:
            mantissa = mantissa * np.uint64(10) + np.uint64(c - 48)
            digits += digits > 0 or c > 48
            exponent -= point
            valid = True
        i += 1
    if valid and (_byte(text, i) == 101 or _byte(text, i) == 69):  # "e", "E"
        down, scale, valid = _byte(text, i + 1) == 45, 0, False
        i += 2 if down or _byte(text, i + 1) == 43 else 1
        while _is_digit(_byte(text, i)):
            scale = 10 * scale + _byte(text, i) - 48 if scale < 1000 else scale
            valid = True
            i += 1
        exponent += -scale if down else scale
    value, sure = _round(mantissa, exponent)
    return -value if sign == 45 else value, i, valid and digits <= _DIGITS and sure


@inline
def _round(mantissa, exponent):
    """mantissa·10^exponent, and whether it is correctly rounded."""
    power = abs(exponent)
    if mantissa == 0 or power >= len(_POWERS):
        return 0.0, mantissa == 0
    a = np.float64(mantissa)
    p = _POWERS[power, 0]
    q = _POWERS[power, 1]
    if mantissa <= _EXACT and power <= _EXACT_POWER:
        return a / p if exponent < 0 else a * p, True
    remainder = np.float64(np.int64(mantissa - np.uint64(a)))
    if exponent < 0:
        high = a / p
        product, error = _multiply(high, p)
        low = (a - product - error + remainder - high * q) / p
    else:
        high, error = _multiply(a, p)
        low = error + (remainder * p + a * q)
    slack = abs(low) * 2.0**-48 + high * 2.0**-100
    return high + low, high + (low - slack) == high + (low + slack)


@inline
def _multiply(a, b):
    """a·b rounded, and what that leaves (Dekker 1971)."""
    product = a * b
    x = a * _SPLIT
    y = b * _SPLIT
    x = x - (x - a)
    y = y - (y - b)
    return product, ((x * y - product) + x * (b - y) + (a - x) * y) + (a - x) * (b - y)


@inline
def _is_end(c):
    return c == 10 or c == 13  # "\n", "\r"


@inline
def _keyword(text, i):
    """The kind of the line that begins at i, by its keyword, and where the words after that begin."""
    while _byte(text, i) == 32 or _byte(text, i) == 9:  # " ", "\t"
        i += 1
    letter = _byte(text, i)
    if letter == 35 or _is_end(letter):  # "#"
        return NOTHING, i
    kind = F if letter == 102 else V if letter == 118 else REST  # "f", "v"
    if kind == V and (_byte(text, i + 1) == 116 or _byte(text, i + 1) == 110):  # "t", "n"
        i += 1
        kind = VT if _byte(text, i) == 116 else VN
    return kind if _is_blank(_byte(text, i + 1)) else REST, i + 1


@inline
def _next_word(text, i):
    """Where the next word of a line begins, and whether there is one before the line or its comment ends."""
    while _is_blank(_byte(text, i)) and not _is_end(_byte(text, i)):
        i += 1
    return i, _byte(text, i) != 35 and not _is_end(_byte(text, i))  # "#"


@inline
def _skip_word(text, i):
    """Where the word at text[i] ends: at a blank, or at the # of a comment."""
    while _byte(text, i) != 35 and not _is_blank(_byte(text, i)):  # "#"
        i += 1
    return i


@inline
def _skip_line(text, i):
    """Where the line after that of text[i] begins."""
    while not _is_end(_byte(text, i)):
        i += 1
    return i + 1


@inline
def _parse_word(text, i):
    """The number at i and where its word ends; a NaN whose last bits are i if the word is none that this can round."""
    value, stop, sure = _parse_float(text, i)
    end = _skip_word(text, stop)
    return value if sure and stop == end else np.uint64(_NAN | np.uint64(i)).view(np.float64), end


@kernel
def read_rows(text: UInt8s, begin: int, end: int, numbers: Float64s, counts: Int64s) -> int:
    """Read the numbers of all lines that have words, one after another, and write how many each line has.

    Words become what `_parse_word` makes of them. Returns how many lines there are.
    """
    number, line, i = 0, 0, begin
    while i < end:
        before = number
        i, has_word = _next_word(text, i)
        while has_word:
            numbers[number], i = _parse_word(text, i)
            number += 1
            i, has_word = _next_word(text, i)
        if number > before:
            counts[line] = number - before
            line += 1
        i = _skip_line(text, i)
    return line


@kernel
def survey(text: UInt8s, begin: int, end: int, tally: Int64Rows, other_runs: Int64Rows) -> int:
    """Count the lines of each kind, and find runs of other statements; returns how many runs there are.

    Args:
        tally: zeros (4, 6), by kind up to F: number of lines, lines with enough words, fewest and most words of a line,
            all words, slashes in the words of faces.
        other_runs: (any, 3), filled with runs of lines that are neither `NUMBERED` nor faces: where each begins and
            ends, and how many faces are before it.
    """
    tally[:, LEAST] = NONE
    runs, running, i = 0, False, begin
    while i < end:
        line = i
        kind, i = _keyword(text, i)
        words = 0
        # A vertex, one of its vt and vn, or a face: its words are counted.
        if kind < REST:
            i, has_word = _next_word(text, i)
            while has_word:
                words += 1
                word, i = i, _skip_word(text, i)
                for k in range(word, i if kind == F else word):
                    tally[F, SLASHES] += _byte(text, k) == 47  # "/"
                i, has_word = _next_word(text, i)
            tally[kind, COUNT] += 1
            tally[kind, USABLE] += words >= NEEDED[kind]
            tally[kind, LEAST] = min(tally[kind, LEAST], words)
            tally[kind, MOST] = max(tally[kind, MOST], words)
            tally[kind, WORDS] += words
            running = False
        i = _skip_line(text, i)
        # Another statement begins a run, or is part of one.
        if kind == REST:
            if not running:
                other_runs[runs, 0], other_runs[runs, 2] = line, tally[F, COUNT]
                runs += 1
            other_runs[runs - 1, 1] = i
            running = True
    return runs


@kernel
def read_numbers(text: UInt8s, begin: int, end: int, wanted_kind: int, values: Float64Rows) -> None:
    """Read the first numbers of lines of one kind into `values` (lines, numbers), infinite of lines that lack words."""
    row, i = 0, begin
    while i < end:
        kind, i = _keyword(text, i)
        if kind == wanted_kind:
            words = 0
            i, has_word = _next_word(text, i)
            while has_word and words < values.shape[1]:
                value, i = _parse_word(text, i)
                values[row, words] = value
                words += 1
                i, has_word = _next_word(text, i)
            if words < NEEDED[wanted_kind]:
                values[row, :] = np.inf
            row += 1
        i = _skip_line(text, i)


@kernel
def read_faces(text: UInt8s, begin: int, end: int, before: Int64Rows, sizes: Int64s, indices: Int64Rows) -> bool:
    """The faces; returns whether all words are indices.

    Args: before: (4, 6), the sum of the tallies of all lines before these. sizes: int64 (p,), of all faces.
        indices: int64 (1 or 3, c), of all corners' `NUMBERED`, from 1 on, or `NONE`; relative ones are made absolute.
    """
    v = before[V, COUNT]
    vt = before[VT, COUNT]
    vn = before[VN, COUNT]
    face = before[F, COUNT]
    corner, valid, i = before[F, WORDS], True, begin
    while i < end:
        kind, i = _keyword(text, i)
        v = v + (kind == V)
        vt = vt + (kind == VT)
        vn = vn + (kind == VN)
        if kind == F:
            first_corner = corner
            i, has_word = _next_word(text, i)
            # Each corner: up to three indices with slashes between them.
            while has_word:
                for part in range(len(indices)):
                    indices[part, corner] = NONE
                part = -1
                i = i - 1
                while part < 0 or _byte(text, i) == 47:  # "/"
                    part += 1
                    index, stop, sure = _parse_index(text, i + 1)
                    if stop > i + 1 and part < len(indices):
                        lines = v if part == 0 else vt if part == 1 else vn
                        indices[part, corner] = index + lines + 1 if index < 0 else index
                    i = stop
                    valid &= sure
                corner += 1
                stop = _skip_word(text, i)
                valid &= stop == i
                i, has_word = _next_word(text, stop)
            sizes[face] = corner - first_corner
            face += 1
        i = _skip_line(text, i)
    return valid


@inline
def _parse_index(text, i):
    """The whole number at i, or the largest there is, where it ends, and whether digits follow its sign, if any."""
    begin, sign, size = i, _byte(text, i), 0
    if sign == 45 or sign == 43:  # "-", "+"
        i += 1
    digits = i
    while _is_digit(_byte(text, i)):
        size = 10 * size + _byte(text, i) - 48 if size < _LARGEST // 10 else _LARGEST
        i += 1
    return -size if sign == 45 else size, i, i > digits or digits == begin
