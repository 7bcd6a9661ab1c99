"""Ctrl-C and SIGTERM: they end the command alike but for the status, 128 and the signal's number.

Python calls a handler between two steps of the main thread. A library's call is one step, which may take minutes, so
that a thread ends the process where the handler is not called soon.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

_USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
_SOON, _LAST = 0.5, 10.0  # seconds in which the handler is to be called, and the command then to end
_taken: list[int] = []
_received = [signal.SIGINT]  # the last one
_raised = threading.Event()
at_once: list[Callable[[], object]] = []
"""What is called before the process is ended in the middle of a step: what blocks would do at their end."""


def take() -> None:
    """Both signals end the process in a line from now on: nothing is written while modules are imported."""
    main = sys.modules.get("__mp_main__")  # another one in workers of multiprocessing, which run the command's module
    if threading.current_thread() is threading.main_thread() and main in (None, sys.modules["__main__"]):
        for number, usual in _USUAL.items():
            if signal.getsignal(number) is usual:  # not ignored, as in the background of a script
                _taken.append(number)
        end_process()


def end_process() -> None:
    """Both signals end the process in a line, also while Python ends, once all is written."""
    for number in _taken:
        signal.signal(number, _end)


def raise_interrupt() -> None:
    """Both raise KeyboardInterrupt from now on, once."""
    for number in _taken:
        signal.signal(number, _raise)


def exit_status() -> int:
    """The exit status of a command that was interrupted: 130, or by SIGTERM 143."""
    return 128 + _received[-1]


@contextmanager
def watched() -> Iterator[None]:
    """A signal ends the process also where a library's call keeps Python from raising it, while this lasts."""
    if not _taken or os.name == "nt":  # where numbers of signals go to sockets alone
        yield
        return
    over = threading.Event()
    reader, writer = os.pipe()

    def watch() -> None:
        """End the process for a signal that the main thread does not take, or that does not end it."""
        with os.fdopen(reader, "rb", 0) as signals:
            received = next((byte[0] for byte in iter(lambda: signals.read(1), b"") if byte[0] in _taken), None)
            if received and not (_raised.wait(_SOON) and over.wait(_LAST)):
                _end(received)

    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    with suppress(RuntimeError):  # the system grants no thread
        threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()
        signal.set_wakeup_fd(before)
        os.close(writer)


def _raise(number: int, frame: FrameType | None) -> None:
    for each in _taken:
        signal.signal(each, signal.SIG_IGN)  # what is to be done at the end is done whole
    _received.append(signal.Signals(number))
    _raised.set()
    signal.default_int_handler(number, frame)


def _end(number: int, _: FrameType | None = None) -> None:
    for act in reversed(at_once):
        with suppress(Exception):
            act()
    with suppress(OSError):
        os.write(2, b"interrupted; no file is half-written\n")
    os._exit(128 + number)
