"""The manifest of a batch: what became of each input, as JSON; what a later run need not do again."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any, Literal

from raytrace.errors import InputError
from raytrace.system.atomic import write_json

VERSION = 1
EVERY = 2.0  # seconds between writes while work goes on
Status = Literal["done", "failed", "waiting"]


@dataclass
class Entry:
    """What became of an input.

    Attributes:
        input, output: their names. status: "waiting" also of what an interrupt left out. seconds: of reading, baking
            and writing. message: the summary or the fault. warnings: about the output. sha256: of the bytes of the
            input and of the files that it names. written: that of the output.
    """

    input: str
    output: str
    status: Status = "waiting"
    seconds: float = 0.0
    message: str = ""
    warnings: list[str] = field(default_factory=list)
    sha256: str = ""
    written: str = ""

    def done(self) -> None:
        """Take note of an output that is whole."""
        self.status, self.written = "done", digest([Path(self.output)])


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of the bytes of files in hex digits, nothing where one cannot be read: its bake will say why."""
    hashed = hashlib.sha256()
    try:
        for path in files:
            with path.open("rb") as file:
                while chunk := file.read(1 << 20):
                    hashed.update(chunk)
    except (OSError, ValueError):
        return ""
    return hashed.hexdigest()


class Manifest:
    """The entries of a batch in the order of its inputs, written every few seconds; from any thread.

    Args: path: the file. entries: all of them. about: what else the file says: options and versions.
    """

    def __init__(self, path: Path, entries: list[Entry], about: dict[str, Any]) -> None:
        self.path, self.entries, self._about = path, entries, about
        self._lock, self._due = Lock(), time.monotonic() + EVERY

    def count(self, status: Status) -> int:
        return sum(entry.status == status for entry in self.entries)

    def save(self) -> None:
        """Write it if it is time to."""
        with self._lock:
            if time.monotonic() >= self._due:
                self.write()
                self._due = time.monotonic() + EVERY

    def write(self) -> None:
        """Raises: OutputError: it cannot be written."""
        counts = {status: self.count(status) for status in ("done", "failed", "waiting")}
        entries = [asdict(entry) for entry in self.entries]
        write_json(self.path, {"manifest_version": VERSION, **counts, **self._about, "inputs": entries})

    def resume(self, tell: Callable[[str], object]) -> None:
        """Take over what the file on disk says is done, of the same bytes with the same options and versions.

        Outputs that are gone or have other bytes than were written, and inputs that have changed, are not done.

        Args: tell: called with a line for the user where nothing can be taken over.

        Raises: InputError: the file cannot be read, or is no manifest of this version.
        """
        try:
            stored = json.loads(self.path.read_bytes())
            version, about = stored["manifest_version"], {name: stored[name] for name in self._about}
            done = {each["input"]: Entry(**each) for each in stored["inputs"] if each["status"] == "done"}
        except FileNotFoundError:
            tell(f"{self.path}: nothing to resume; starting from the beginning")
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            version, about, done = None, {}, {}
        if version != VERSION:
            got = "something else" if version is None else f"one of version {version}"
            raise InputError(self.path, "manifest_version", f"a manifest of version {VERSION}", got)
        if about != self._about:
            tell(f"{self.path}: of other options or another version; starting from the beginning")
            return
        for place, entry in enumerate(self.entries):
            found = done.get(entry.input)
            same = found and found.written and (found.output, found.sha256) == (entry.output, entry.sha256)
            if found and same and digest([Path(entry.output)]) == found.written:
                self.entries[place] = found
