"""A bake by the `obscurance` command, in a process and a folder of its own."""

import json
import os
import shutil
import subprocess
import tempfile
import threading
from pathlib import Path

import numpy as np


class BakeFailed(Exception):
    """The bake cannot be done; in one line."""


def find_command(name):
    """The path of a command, or None."""
    return shutil.which(os.path.expanduser(name))


class Results:
    """What a bake has written."""

    def __init__(self, folder, w):
        self._folder = folder
        self._w = w

    def corners(self, source):
        """w (c,) at the corners of an object's faces."""
        return self._w[source.rows]

    def image(self, source):
        """The path of an object's image."""
        return self._folder / f"w_{source.name}.png"


class Job:
    """A running bake. `with job as results:` waits for it, and removes its files afterwards."""

    def __init__(self, command, sources, options):
        self._folder = Path(tempfile.mkdtemp(prefix="obscurance-"))
        self.share, self.stage, self.summary = 0.0, "starting", ""
        self._said = []
        (self._folder / "scene.glb").write_bytes(sources.mesh)
        words = [command, "bake", "scene.glb", *options, "--progress", "json"]
        if sources.occluder:
            (self._folder / "others.glb").write_bytes(sources.occluder)
            words += ["--occluder", "others.glb"]
        words += ["-o", "w_<OBJECT>.png" if "--size" in options else "w.npy"]
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        try:
            self._process = subprocess.Popen(
                words, cwd=self._folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                stderr=subprocess.PIPE, text=True, encoding="utf-8", errors="replace",
            )  # fmt: skip
        except OSError:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise
        self._readers = [
            threading.Thread(target=self._hear, args=(stream,), daemon=True)
            for stream in (self._process.stdout, self._process.stderr)
        ]
        for reader in self._readers:
            reader.start()

    @property
    def is_running(self):
        """Whether the process has not ended."""
        return self._process.poll() is None

    def wait(self):
        """Until the process has ended."""
        self._process.wait()
        for reader in self._readers:
            reader.join()

    def cancel(self):
        """End the process, and remove its files."""
        self._process.terminate()
        self.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _hear(self, stream):
        """Take in lines: progress, or words."""
        for line in stream:
            try:
                event = json.loads(line)
                self.share, self.stage = event["done"] / max(event["total"], 1), event["stage"] or event["unit"]
            except (ValueError, KeyError, TypeError):
                self._said.append(line.strip())

    def __enter__(self):
        self.wait()
        array = self._folder / "w.npy"
        if self._process.returncode or not any(self._folder.glob("w*")):
            shutil.rmtree(self._folder, ignore_errors=True)
            raise BakeFailed(self._said[-1] if self._said else f"obscurance ended with {self._process.returncode}")
        self.summary = next((line.partition(": ")[2] for line in reversed(self._said) if "RMSE" in line), "")
        return Results(self._folder, np.load(array) if array.exists() else None)

    def __exit__(self, *_):
        shutil.rmtree(self._folder, ignore_errors=True)
