"""Another program in a process and an interpreter of its own, asked one thing at a time.

The peer's half of the protocol is `serve.py`: JSON, one line a message. The first says what the peer is; each further
one answers a request.
"""

from __future__ import annotations

import json
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent


class PeerFailed(RuntimeError):
    """A peer has ended, or did not understand."""


class Process:
    """A peer that runs `script`, a file beside this one, by the interpreter `python`.

    Attributes:
        about: what the peer said of itself, its `version` above all.

    Raises:
        PeerFailed: it does not start; what it wrote to standard error says why.
    """

    def __init__(self, python: str | Path, script: str, *arguments: str | Path) -> None:
        self.process = subprocess.Popen(
            [str(part) for part in (python, FOLDER / script, *arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.script = script
        try:
            self.about = self._message()
        except PeerFailed:
            self.close()
            raise

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    def ask(self, **request: Any) -> dict[str, Any]:
        """The peer's answer to a request.

        Raises:
            PeerFailed: it has ended.
        """
        assert self.process.stdin
        with suppress(BrokenPipeError):  # the missing answer tells
            self.process.stdin.write(json.dumps(request) + "\n")
            self.process.stdin.flush()
        return self._message()

    def close(self) -> None:
        """End the peer: it stops at the end of its requests."""
        self.process.communicate()

    def _message(self) -> dict[str, Any]:
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            raise PeerFailed(f"{self.script} has ended; see its message above")
        message: dict[str, Any] = json.loads(line)
        return message
