"""OpenImageIO, imported with interrupts held back: one while its C++ starts aborts the process without a line."""

import signal
import sys
import threading
from typing import Any

_HELD = signal.SIGINT, signal.SIGTERM


def openimageio() -> Any:
    """The module; an interrupt that came while it was imported is raised afterwards."""
    if "OpenImageIO" in sys.modules or threading.current_thread() is not threading.main_thread():
        import OpenImageIO

        return OpenImageIO
    received: list[int] = []
    handlers = {number: signal.signal(number, lambda got, _: received.append(got)) for number in _HELD}
    try:
        import OpenImageIO
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler or signal.SIG_DFL)
    for got in received:
        signal.raise_signal(got)
    return OpenImageIO
