"""Notes, warnings and summaries of the commands."""

from __future__ import annotations

import codecs
import io
import os
import sys
import threading
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from obscurance.raytrace.errors import LINE, printable

if TYPE_CHECKING:
    from obscurance import ao
    from obscurance.raytrace.mesh.mesh import Mesh


def note(message: str) -> None:
    """Print a note on standard error, in one line."""
    print("obscurance: " + printable(" ".join(message.split()), LINE), file=sys.stderr)


_PLAIN = str.maketrans({
    "τ": "tau", "μ": "mu", "ρ": "rho", "σ": "sigma", "η": "eta", "π": "pi", "ω": "omega", "θ": "theta", "φ": "phi",
    "×": "x", "−": "-", "–": "-", "°": " degrees", "∫": "integral ", "∥": "|", "⊥": "_|_", "≤": "<=", "≥": ">=",
    "…": "...", "“": '"', "”": '"', "’": "'", "→": "->", "·": "*", "∞": "inf", "²": "^2", "³": "^3", "—": "-",
})  # fmt: skip


def _in_plain_letters(fault: UnicodeError) -> tuple[str, int]:
    """Similar letters for characters that an output cannot encode, else escapes."""
    if not isinstance(fault, UnicodeEncodeError):
        raise fault
    import unicodedata

    characters = fault.object[fault.start : fault.end].translate(_PLAIN)
    letters = unicodedata.normalize("NFKD", characters).translate(_PLAIN)
    return "".join(c if c.isascii() else "" if unicodedata.combining(c) else ascii(c)[1:-1] for c in letters), fault.end


def reopen_streams() -> None:
    """Replace standard streams that were closed before the start, whose numbers the next opened files would get.

    Reading and writing then fails with an error of the system; what goes to standard error is dropped.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDONLY if name == "stdout" else os.O_WRONLY)  # the least number that is free
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))


@contextmanager
def readable_output() -> Iterator[None]:
    """Let standard output and standard error write any text, whatever their encoding, while this lasts."""
    codecs.register_error("plain-letters", _in_plain_letters)
    kept = {}
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            kept[stream] = stream.errors
            stream.reconfigure(errors="plain-letters")
    try:
        yield
    finally:
        for stream, errors in kept.items():
            stream.reconfigure(errors=errors)


def output_failed(failure: OSError) -> int:
    """Report an error of the system in one line, unless a pipe was closed; returns the exit status."""
    with suppress(OSError, ValueError):  # what is still buffered has nowhere to go
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if not isinstance(failure, BrokenPipeError):
        note(f"{failure.filename or 'standard output'}: {failure.strerror or failure}")
    return 1


def unforeseen(fault: Exception) -> str:
    """A fault of the program in one line: what it is, and where it came up."""
    file, line, _, _ = traceback.extract_tb(fault.__traceback__)[-1]
    what = f"{type(fault).__name__}: {fault}" if str(fault) else type(fault).__name__
    place = "/".join(Path(file).parts[-3:])
    return f"{what} ({place}, line {line}): a fault of the program, to be reported; no file is half-written"


_silent = threading.local()  # its `on`: whether warnings on this thread are printed by the caller


@contextmanager
def unprinted_warnings() -> Iterator[None]:
    """Let `warn` print nothing on this thread, while this lasts: who asked for the work is elsewhere."""
    _silent.on = True
    try:
        yield
    finally:
        _silent.on = False


_quiet: list[bool] = []


@contextmanager
def quietly(quiet: bool) -> Iterator[None]:
    """Print no warnings about results while this lasts, if `quiet`."""
    _quiet[:] = [quiet] if quiet else []
    try:
        yield
    finally:
        _quiet.clear()


HARD = "vertices lie on hard edges"


def warn(
    meshes: Iterable[Mesh], others: Iterable[str] = (), falloff: ao.Falloff | None = None, of_points: bool = False
) -> list[str]:
    """Print, once each, warnings about the precision of meshes, and `others`, losses of an output as notes; return all.

    Args: falloff: that is relative to the radius of the last of the meshes, perhaps. of_points: that one is of discs,
        whose normals are the file's.
    """
    from obscurance.raytrace.mesh.warnings import outlier_warnings, precision_warnings

    from ..show.report.verdict import COARSE

    distinct = list({id(mesh): mesh for mesh in meshes}.values())
    of_faces = distinct[: len(distinct) - of_points]
    warnings = list(dict.fromkeys(warning for mesh in of_faces for warning in precision_warnings(mesh)))
    if falloff and len({(mu.max_distance, mu.tau) for mu in map(falloff.resolve, (1.0, 2.0))}) > 1:
        warnings += outlier_warnings(distinct[-1])
    warnings += list(dict.fromkeys(others))
    printed = [] if getattr(_silent, "on", False) else warnings
    for warning in (line for line in printed if not (_quiet and (COARSE in line or HARD in line))):
        kind = "note" if any(words in warning for words in (": not kept from ", ": in the pose ")) else "warning"
        print(f"{kind}: {printable(warning, LINE)}", file=sys.stderr)
    return warnings


def bake_summary(baked: ao.Bake, target: Path) -> str:
    """The line after a bake: file, vertices, rays, time, estimated error; and one for each flag that vertices have."""
    from ..show.report.verdict import ONE_OF, flags_in_words

    took = f"{_took(baked)}, estimated RMSE {baked.rmse:.4f}"
    elements = f"1 {ONE_OF[baked.at]}" if len(baked.w) == 1 else f"{len(baked.w):,} {baked.at}"
    text = f"{printable(str(target))}: {elements}, {baked.rays:,} rays traced {took}"
    flags = flags_in_words(baked.flagged, len(baked.w), baked.rays_skipped, baked.at)
    return "\n".join([text, *(words for name, words in flags.items() if name != "contact")])  # usual where parts meet


def _took(baked: ao.Bake | ao.BakedTexture) -> str:
    return f"in {baked.seconds['bake']:.2f} s"


def texture_summary(baked: ao.BakedTexture, target: str) -> str:
    """The line after a bake of a texture, and a second one about its layout and seams."""
    (height, width), facts = baked.w.shape, baked.facts
    rays = f"{baked.rays:,} rays traced {_took(baked)}, estimated RMSE {baked.rmse:.4f}"
    text = f"{printable(target)}: {width}×{height}, {facts.covered:,} texels covered, {rays}"
    if not facts.seam_edges:
        return text
    jumps = f"by {facts.seam_jump:.4f} at most, by {facts.seam_jump_before:.4f} before they were closed"
    return f"{text}\nw, the openness, jumps at the {facts.seam_edges:,} edges of seams {jumps}"


def columns(named_values: Sequence[tuple[str, str]]) -> str:
    """Lines of names and values, the values below one another."""
    width = max(len(name) for name, _ in named_values)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in named_values)
