"""Ctrl-C while the command imports its modules, for a tenth of a second: a line and status 130, no traceback."""

import os
import signal
import threading

_guards = threading.current_thread() is threading.main_thread() and (
    signal.getsignal(signal.SIGINT) is signal.default_int_handler  # not ignored, as in the background of a script
)


def _end(*_: object) -> None:
    os.write(2, b"interrupted; no file is half-written\n")  # nothing is written as yet
    os._exit(130)


def all_imported() -> None:
    """Interrupts raise KeyboardInterrupt again."""
    if _guards:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if _guards:
    signal.signal(signal.SIGINT, _end)
