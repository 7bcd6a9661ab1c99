"""Ctrl-C and SIGTERM: alike, and a line and status 130 also while modules are imported, for a tenth of a second."""

import os
import signal
import sys
import threading

_USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
_main = sys.modules.get("__mp_main__")  # another one where multiprocessing starts a worker, and runs the command anew
_taken = [
    number
    for number, usual in _USUAL.items()
    if threading.current_thread() is threading.main_thread()
    and signal.getsignal(number) is usual  # not ignored, as in the background of a script
    and _main in (None, sys.modules["__main__"])
]


def _end(*_: object) -> None:
    os.write(2, b"interrupted; no file is half-written\n")  # nothing is written as yet
    os._exit(130)


def all_imported() -> None:
    """Both raise KeyboardInterrupt from now on."""
    for number in _taken:
        signal.signal(number, signal.default_int_handler)


for number in _taken:
    signal.signal(number, _end)
