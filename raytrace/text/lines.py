"""Lines of numbers, and of a Wavefront OBJ file, for kernels that share its bytes: each takes text[begin:end].

The last byte of `text` must be the end of a line, so that no loop passes it.
"""

import numpy as np

from ..kernel.jit import inline, kernel
from .decimal import byte, is_blank, is_digit, parse_float

NUMBERED = "v", "vt", "vn"
V, VT, VN, F, REST, NOTHING = range(6)
"""Kinds of lines: statements of `NUMBERED`, faces, other statements, and comments or blanks."""
NONE = 1 << 62  # the index of a corner that has none
NEEDED = np.array([3, 2, 3, 0])
"""Words that a line of each kind needs."""
COUNT, USABLE, LEAST, MOST, WORDS, SLASHES = range(6)  # columns of a tally
_LARGEST = (1 << 63) - 1
_NAN = np.uint64(0x7FF8 << 48)


@inline
def _is_end(c):
    return c == 10 or c == 13


@inline
def _keyword(text, i):
    """The kind of the line that begins at i, and where its words begin."""
    while byte(text, i) == 32 or byte(text, i) == 9:
        i += 1
    first = byte(text, i)
    if first == 35 or _is_end(first):
        return NOTHING, i
    kind = F if first == 102 else V if first == 118 else REST
    if kind == V and (byte(text, i + 1) == 116 or byte(text, i + 1) == 110):
        i += 1
        kind = VT if byte(text, i) == 116 else VN
    return kind if is_blank(byte(text, i + 1)) else REST, i + 1


@inline
def _next_word(text, i):
    """Where the next word of a line begins, and whether there is one before the line or its comment ends."""
    while is_blank(byte(text, i)) and not _is_end(byte(text, i)):
        i += 1
    return i, byte(text, i) != 35 and not _is_end(byte(text, i))


@inline
def _skip_word(text, i):
    while byte(text, i) != 35 and not is_blank(byte(text, i)):
        i += 1
    return i


@inline
def _skip_line(text, i):
    while not _is_end(byte(text, i)):
        i += 1
    return i + 1


@inline
def _parse_word(text, i, powers):
    """The number at i, where its word ends, and whether all of the word is one that `parse_float` can round."""
    value, stop, sure = parse_float(text, i, powers)
    end = _skip_word(text, stop)
    return value, end, sure and stop == end


@kernel
def read_rows(text, begin, end, powers, numbers, counts):
    """The numbers of all lines that have words, one after the other.

    What `parse_float` leaves becomes a NaN whose last bits say where the word begins.

    Args:
        powers: `raytrace.text.decimal.POWERS`.
        numbers, counts: float64 and int64 (any,), filled with the numbers, and with how many each such line has.

    Returns how many such lines there are.
    """
    bits, found, rows, i = numbers.view(np.uint64), 0, 0, begin
    while i < end:
        before = found
        i, some = _next_word(text, i)
        while some:
            word = i
            numbers[found], i, sure = _parse_word(text, word, powers)
            if not sure:
                bits[found] = _NAN | np.uint64(word)
            found += 1
            i, some = _next_word(text, i)
        if found > before:
            counts[rows] = found - before
            rows += 1
        i = _skip_line(text, i)
    return rows


@kernel
def survey(text, begin, end, tally, rest):
    """Count the lines.

    Args:
        tally: zeros (4, 6), of each kind up to F: lines, those that have the words they need, the fewest and the most
            words of a line, words, slashes in the words of faces.
        rest: (any, 3), is filled with runs of other statements: where each begins and ends, and faces before it.

    Returns how many such runs there are.
    """
    tally[:, LEAST] = NONE
    runs, running, i = 0, False, begin
    while i < end:
        line = i
        kind, i = _keyword(text, i)
        words = 0
        if kind < REST:
            i, some = _next_word(text, i)
            while some:
                words += 1
                word, i = i, _skip_word(text, i)
                for k in range(word, i if kind == F else word):
                    tally[F, SLASHES] += byte(text, k) == 47
                i, some = _next_word(text, i)
            tally[kind, COUNT] += 1
            tally[kind, USABLE] += words >= NEEDED[kind]
            tally[kind, LEAST] = min(tally[kind, LEAST], words)
            tally[kind, MOST] = max(tally[kind, MOST], words)
            tally[kind, WORDS] += words
            running = False
        i = _skip_line(text, i)
        if kind == REST:
            if not running:
                rest[runs, 0], rest[runs, 2] = line, tally[F, COUNT]
                runs += 1
            rest[runs - 1, 1] = i
            running = True
    return runs


@kernel
def read_numbers(text, begin, end, wanted, powers, rows):
    """The first numbers of those lines that are of the kind `wanted` and have the words that it needs.

    Args: as of `read_rows`. rows: float64 (lines, numbers).
    """
    bits, row, i = rows.view(np.uint64), 0, begin
    while i < end:
        kind, i = _keyword(text, i)
        if kind == wanted:
            words = 0
            i, some = _next_word(text, i)
            while some and words < rows.shape[1]:
                word = i
                value, i, sure = _parse_word(text, word, powers)
                if row < len(rows):
                    rows[row, words] = value
                    if not sure:
                        bits[row, words] = _NAN | np.uint64(word)
                words += 1
                i, some = _next_word(text, i)
            row += words >= NEEDED[wanted]
        i = _skip_line(text, i)


@kernel
def read_faces(text, begin, end, before, sizes, indices):
    """The faces.

    Args:
        before: (4, 6), the sum of the tallies of all lines before these.
        sizes: int64 (p,), of all faces. indices: int64 (1 or 3, c), of all corners' `NUMBERED`, from 1 on, or `NONE`;
            relative ones are made absolute.

    Returns whether all words are indices.
    """
    v, vt, vn, face = before[V, COUNT], before[VT, COUNT], before[VN, COUNT], before[F, COUNT]
    corner, valid, i = before[F, WORDS], True, begin
    while i < end:
        kind, i = _keyword(text, i)
        v, vt, vn = v + (kind == V), vt + (kind == VT), vn + (kind == VN)
        if kind == F:
            first = corner
            i, some = _next_word(text, i)
            while some:
                for part in range(len(indices)):
                    indices[part, corner] = NONE
                part, i = -1, i - 1
                while part < 0 or byte(text, i) == 47:
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
                i, some = _next_word(text, stop)
            sizes[face] = corner - first
            face += 1
        i = _skip_line(text, i)
    return valid


@inline
def _parse_index(text, i):
    """The whole number at i, or the largest there is, where it ends, and whether digits follow its sign, if any."""
    begin, sign, size = i, byte(text, i), 0
    if sign == 45 or sign == 43:
        i += 1
    digits = i
    while is_digit(byte(text, i)):
        size = 10 * size + byte(text, i) - 48 if size < _LARGEST // 10 else _LARGEST
        i += 1
    return -size if sign == 45 else size, i, i > digits or digits == begin
