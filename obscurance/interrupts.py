"""Ctrl-C and SIGTERM: alike but for the status, 128 and the signal's number, also while modules are imported."""

import os
import signal
import sys
import threading
from types import FrameType

_USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
_main = sys.modules.get("__mp_main__")  # another one where multiprocessing starts a worker, and runs the command anew
_taken = [
    number
    for number, usual in _USUAL.items()
    if threading.current_thread() is threading.main_thread()
    and signal.getsignal(number) is usual  # not ignored, as in the background of a script
    and _main in (None, sys.modules["__main__"])
]


_received = [signal.SIGINT]  # the last one


def _end(number: int, _: object) -> None:
    os.write(2, b"interrupted; no file is half-written\n")  # nothing is written as yet
    os._exit(128 + number)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _received.append(signal.Signals(number))
    signal.default_int_handler(number, frame)


def exit_status() -> int:
    """What a command ends with that was interrupted: 130, or by SIGTERM 143."""
    return 128 + _received[-1]


def all_imported() -> None:
    """Both raise KeyboardInterrupt from now on."""
    for number in _taken:
        signal.signal(number, _interrupt)


for number in _taken:
    signal.signal(number, _end)
