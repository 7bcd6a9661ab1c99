"""Ctrl-C and SIGTERM: alike but for the status, 128 and the signal's number, also while modules are imported.

The interpreter calls handlers between two steps of the main thread. A library's call may be one step of many seconds,
so a thread of its own hears of each signal, too, and ends the process if the handler is not called soon.
"""

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
_handled = threading.Event()  # a handler was called for the last signal
_PATIENCE = 0.8  # seconds until it is to be


def _end(number: int, _: object) -> None:
    os.write(2, b"interrupted; no file is half-written\n")  # outputs are renamed when they are whole
    os._exit(128 + number)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _handled.set()
    _received.append(signal.Signals(number))
    signal.default_int_handler(number, frame)


def exit_status() -> int:
    """What a command ends with that was interrupted: 130, or by SIGTERM 143."""
    return 128 + _received[-1]


def all_imported() -> None:
    """Both raise KeyboardInterrupt from now on."""
    for number in _taken:
        signal.signal(number, _interrupt)


def _watch(signals: int) -> None:
    """End the process when no handler is called for a signal whose number comes out of the pipe `signals`."""
    while number := os.read(signals, 1):
        if number[0] in _taken and not _handled.wait(_PATIENCE):
            _end(number[0], None)
        _handled.clear()


for number in _taken:
    signal.signal(number, _end)
if _taken:
    _reader, _writer = os.pipe()
    os.set_blocking(_writer, False)
    signal.set_wakeup_fd(_writer, warn_on_full_buffer=False)
    if hasattr(os, "register_at_fork"):  # what a child receives is not for this process
        os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))
    threading.Thread(target=_watch, args=(_reader,), daemon=True).start()
