"""The manifest of a batch as JSON, with the outcome of each input."""

import hashlib
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from obscurance.raytrace.errors import InputError
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.system.checks import check_regular
from obscurance.raytrace.system.records import Fault, read

from ..json_toml import parse_json

MANIFEST = "manifest.json"
VERSION = 1
EVERY = 2.0  # seconds between writes while work goes on
Status = Literal["done", "failed", "waiting"]


@dataclass
class Entry:
    """The outcome of an input, with the names of files."""

    input: str
    output: str
    status: Status = "waiting"  # also of what an interrupt left out
    seconds: float = 0.0  # of reading, baking and writing
    message: str = ""  # the summary or the fault
    warnings: list[str] = field(default_factory=list)
    sha256: str = ""  # of the bytes of the input and of the files that it names
    output_sha256: str = ""

    def done(self) -> None:
        """Record the hash of an output that is written as a whole."""
        self.status = "done"
        self.output_sha256 = digest([Path(self.output)])


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of the bytes of files in hex digits, nothing where one cannot be read: its bake will say why."""
    hashed = hashlib.sha256()
    try:
        for path in files:
            check_regular(path, "a file")
            with path.open("rb") as file:
                hashlib.file_digest(file, lambda: hashed)
    except (OSError, ValueError):
        return ""
    return hashed.hexdigest()


class Manifest:
    """The entries of a batch, written every few seconds. Args: about: options and versions."""

    def __init__(self, path: Path, entries: list[Entry], about: dict[str, Any]) -> None:
        self.path, self.entries, self._about = path, entries, about
        self._due = time.monotonic() + EVERY

    def count(self, status: Status) -> int:
        return sum(entry.status == status for entry in self.entries)

    def save(self) -> None:
        """Write the manifest, if the last time is some seconds ago."""
        if time.monotonic() >= self._due:
            self.write()
            self._due = time.monotonic() + EVERY

    def write(self) -> None:
        """Write the manifest now. Raises: OutputError."""
        counts = {status: self.count(status) for status in ("done", "failed", "waiting")}
        entries = [asdict(entry) for entry in self.entries]
        write_json(self.path, {"manifest_version": VERSION, **counts, **self._about, "inputs": entries})

    def resume(self, notify: Callable[[str], object]) -> None:
        """Take over the entries of the file on disk that are done, of the same bytes with the same options and
        versions.

        Outputs that are gone or have other bytes than were written, and inputs that have changed, are not done.

        Args: notify: called with a line for the user.
        """
        try:
            stored = parse_json(self.path.read_bytes())
            version = stored["manifest_version"]
            facts = {name: stored[name] for name in self._about}
            entries = read(list[Entry], stored["inputs"])
            done = {entry.input: entry for entry in entries if entry.status == "done"}
        except FileNotFoundError:
            notify(f"{self.path}: nothing to resume; starting from the beginning")
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, Fault):
            version = None
            facts = {}
            done = {}
        if version != VERSION:
            got = "something else" if version is None else f"one of version {version}"
            raise InputError(self.path, "manifest_version", f"a manifest of version {VERSION}", got)
        if facts != self._about:
            notify(f"{self.path}: of other options or another version; starting from the beginning")
            return
        for number, entry in enumerate(self.entries):
            earlier = done.get(entry.input)
            if not earlier or not earlier.output_sha256:
                continue
            is_same = (earlier.output, earlier.sha256) == (entry.output, entry.sha256)
            if is_same and digest([Path(entry.output)]) == earlier.output_sha256:
                self.entries[number] = earlier
