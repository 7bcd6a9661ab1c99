"""A headless Chromium without any network, driven through a pipe by its DevTools protocol."""

import base64
import fcntl
import json
import os
import select
import shutil
import signal
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

_BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
MISSING = None if _BROWSER else "chromium is not installed"
"""Why no browser can be started, in words, or None."""
FLAGS = (
    *("--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic"),
)
"""Of a browser that draws in software and asks for nothing by itself."""
_FLAGS = (*FLAGS, "--host-resolver-rules=MAP * ~NOTFOUND", "--remote-debugging-pipe", "--hide-scrollbars")
_FLAGS += ("--disable-gpu-compositing",)  # half the cost of a page, whose canvases are read back then
_READ_BACK = "GPU stall due to ReadPixels"  # what the driver says of that
_SECONDS = 60


class Browser:
    """One tab. `messages` is what was logged: console calls, exceptions, refusals by the policy, failed requests."""

    def __init__(self, write, read):
        self._write, self._read, self._buffer, self._number = write, read, b"", 0
        self._events, self.messages, self.requests = [], [], []
        (page,) = [each for each in self.call("Target.getTargets")["targetInfos"] if each["type"] == "page"]
        flat = {"targetId": page["targetId"], "flatten": True}
        self._session = None
        self._session = self.call("Target.attachToTarget", **flat)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """The result of a method of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        session = getattr(self, "_session", None)
        if session:
            message["sessionId"] = session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _next(self):
        limit = time.monotonic() + _SECONDS
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(limit - time.monotonic(), 0))
            if not ready:
                raise TimeoutError("the browser does not answer")
            received = os.read(self._read, 1 << 20)
            if not received:
                raise RuntimeError("the browser has ended")
            self._buffer += received
        text, _, self._buffer = self._buffer.partition(b"\0")
        message = json.loads(text)
        method, given = message.get("method"), message.get("params", {})
        if method == "Runtime.consoleAPICalled":
            self.messages.append(" ".join(str(each.get("value", each)) for each in given["args"]))
        elif method == "Runtime.exceptionThrown":
            self.messages.append(json.dumps(given["exceptionDetails"]))
        elif method == "Log.entryAdded" and _READ_BACK not in given["entry"]["text"]:
            self.messages.append(given["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(given["request"]["url"])
        return message

    def open(self, address, width=960, height=640, scale=1, dark=True):
        """Open a page in a window of this size and wait until its script says that it has drawn."""
        self.resize(width, height, scale)
        preference = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=preference)
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=address)
        self.wait("location.href !== 'about:blank' && document.readyState === 'complete'")

    def resize(self, width, height, scale=1):
        """Give the window another size."""
        size = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def run(self, expression):
        """The value of a JavaScript expression."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(json.dumps(found["exceptionDetails"]))
        return found["result"].get("value")

    def wait(self, condition, seconds=_SECONDS):
        """Until a JavaScript expression is true; its value."""
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            found = self.run(condition)
            if found:
                return found
            time.sleep(0.02)
        raise TimeoutError(f"{condition} is not: {self.messages}")

    def screenshot(self, element=None):
        """The window, or the part of it that an element takes, as a PNG. Args: element: its id."""
        clip = {}
        if element:
            box = self.run(f"JSON.parse(JSON.stringify(document.getElementById({element!r}).getBoundingClientRect()))")
            clip = {"clip": {name: box[name] for name in ("x", "y", "width", "height")} | {"scale": 1}}
        return base64.b64decode(self.call("Page.captureScreenshot", format="png", **clip)["data"])

    def press(self, key, shift=False):
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {"text": "\r"} if key == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 * shift, **(text if kind == "keyDown" else {})
            )

    def drag(self, *points, button="left", shift=False):
        """Press the mouse at the first point, move over the others, release at the last; one point is a click."""
        held = {"left": 1, "right": 2, "middle": 4}[button]
        common = {"button": button, "modifiers": 8 * shift, "clickCount": 1}
        for number, (x, y) in enumerate(points):
            kind = "mouseMoved" if number else "mousePressed"
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=held, **common)
        x, y = points[-1]
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, buttons=0, **common)

    def wheel(self, x, y, amount):
        """Turn the wheel over a point."""
        self.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=amount)

    def touch(self, *frames):
        """Fingers: each frame is a list of points; the first touches, the last is let go."""
        for number, frame in enumerate(frames):
            points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in enumerate(frame)]
            self.call("Input.dispatchTouchEvent", type="touchMove" if number else "touchStart", touchPoints=points)
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])


@contextmanager
def browser():
    """A browser while the block lasts."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        (their_read, write), (read, their_write) = (map(_high, os.pipe()) for _ in range(2))
        log = os.open(os.devnull, os.O_RDWR)
        actions = [(os.POSIX_SPAWN_DUP2, their_read, 3), (os.POSIX_SPAWN_DUP2, their_write, 4)]
        actions += [(os.POSIX_SPAWN_DUP2, log, each) for each in (0, 1, 2)]
        command = [_BROWSER, *_FLAGS, f"--user-data-dir={Path(profile) / 'profile'}", "about:blank"]
        process = os.posix_spawn(command[0], command, os.environ, file_actions=actions, setpgroup=0)
        for each in (their_read, their_write, log):
            os.close(each)
        try:
            yield Browser(write, read)
        finally:
            os.killpg(process, signal.SIGKILL)
            os.waitpid(process, 0)
            os.close(write)
            os.close(read)


def _high(descriptor):
    """The descriptor under a number that is out of the way of 3 and 4."""
    moved = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(descriptor)
    return moved
