"""glTF files as three.js shows them in a headless Chromium, to be compared with pictures of our own.

`make viewers` installs three.js; Chromium is Debian's package. Everything is served on the loopback address, and no
other host is resolved.
"""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
import tempfile
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ROOT
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.types import Float32s

from .chromium import FLAGS

PACKAGES = ROOT / ".viewers" / "node_modules"
PAGE = Path(__file__).with_suffix(".html")
_FLAGS = (*FLAGS, "--disable-gpu", "--virtual-time-budget=60000")
_ONLY_HERE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
_SECONDS = 300


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        """Nothing."""


def missing() -> str | None:
    """What is not installed that `shown` needs, in words, or None."""
    if not (PACKAGES / "three").is_dir():
        return "three.js is not installed: make viewers"
    return None if shutil.which("chromium") else "chromium is not installed"


def shown(
    files: list[Path],
    camera: Camera,
    size: tuple[int, int],
    *,
    ambient: float = 1.0,
    sun: float = 0.0,
    towards_sun: tuple[float, float, float] = (0.0, 1.0, 0.0),
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Float32s]:
    """Linear pictures (height, width, 3) of .glb files.

    Args:
        camera: a perspective one. size: width and height in pixels.
        ambient, sun: what a white matt surface reflects of the ambient light, and of the sun if that is overhead.
        background: linear RGB.
    """
    width, height = size
    far = float(np.linalg.norm(np.subtract(camera.position, camera.target)))
    view = {
        "width": width, "height": height, "position": list(camera.position), "target": list(camera.target),
        "up": list(camera.up), "field_of_view": camera.field_of_view, "near": far / 100, "far": far * 100,
        "ambient": pi * ambient, "sun": pi * sun, "towards_sun": list(towards_sun), "background": list(background),
        "files": [f"{number}.glb" for number in range(len(files))],
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "page"
        folder.mkdir()
        (folder / "view.json").write_text(json.dumps(view))
        shutil.copy(PAGE, folder / "index.html")
        (folder / "node_modules").symlink_to(PACKAGES)
        for number, file in enumerate(files):
            shutil.copy(file, folder / f"{number}.glb")
        dom = _dom(folder, Path(name) / "profile")
        found = re.search(r"<body>(\[.*\])</body>", dom, re.DOTALL)
        if not found:
            raise RuntimeError(f"the page drew nothing: {dom[-500:]}")
        pictures = []
        for number, url in enumerate(json.loads(html.unescape(found[1]))):
            file = folder / f"{number}.png"
            file.write_bytes(base64.b64decode(url.partition("base64,")[2]))
            pictures.append(read_image(file)[0]["beauty"][..., :3])
    return pictures


def _dom(folder: Path, profile: Path) -> str:
    """What becomes of a folder's page in the browser."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        address = f"http://127.0.0.1:{server.server_address[1]}/index.html"
        command = ["chromium", *_FLAGS, _ONLY_HERE, f"--user-data-dir={profile}", "--dump-dom", address]
        return subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=True).stdout
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
