"""Saying that kernels are compiled: in the first use of a version, for up to a minute, nothing else would be heard."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

notices: list[Callable[[str], None]] = []
"""Called with the name of each kernel that is about to be compiled; one at most."""


@contextmanager
def compiling(expected: int = 42, always: bool = False, quiet: bool = False) -> Iterator[None]:
    """Say that kernels are being compiled, if they are, and on a terminal or in a notebook how far that is.

    It goes to standard error, and to the logger "obscurance" at the level INFO. Within another one it does nothing.

    Args: expected: about how many kernels the work takes; a texture or a picture takes nearly as many as a bake.
        always: whether other outputs than terminals get the line. quiet: whether the logger alone hears of it.
    """
    if notices:
        yield
        return
    interactive = not quiet and sys.stderr is not None and (sys.stderr.isatty() or hasattr(sys, "ps1"))
    begun = 0

    def notice(name: str) -> None:
        import logging

        nonlocal begun
        begun += 1
        first = _is_first_run()
        logging.getLogger("obscurance").info("compiling kernel %d: %s", begun, name)
        if begun == 1 and not quiet and (interactive or always):
            _announce(first)
        if interactive:
            text = f"{begun} of about {max(expected, begun)}" if first else name.split(".")[-2]
            print(f"\r{text:<30}", end="", file=sys.stderr, flush=True)

    notices.append(notice)
    try:
        yield
    finally:
        notices.remove(notice)
        if begun and interactive:
            print(f"\r{'':<30}\r", end="", file=sys.stderr, flush=True)


@cache
def _is_first_run() -> bool:
    """Whether no process has kept a kernel of this version; asked before this one does."""
    from .cache import cache_folder

    folder = cache_folder()
    return folder is None or not folder.exists()


@cache
def _announce(first: bool) -> None:
    """Print once a process what is going on."""
    further = "Compiling kernels that no run of this version has needed before…"
    print("First run of this version: compiling kernels takes up to a minute…" if first else further, file=sys.stderr)
