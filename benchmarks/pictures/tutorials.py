"""What the tutorials show: `python -m benchmarks.pictures.tutorials`, part of `make pictures`, writes it into them.

A tutorial of docs/tutorials is read as a notebook. Python code runs from top to bottom with common names; what it
prints, and the value of its last line, stand in the block of text after it, a value that is a picture in the picture
after it. Commands run in the same folder. `tests/project/test_tutorials.py` checks what a page shows.
"""

from __future__ import annotations

import ast
import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from benchmarks import ROOT

PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
_BLOCK = re.compile(r"^```(python|sh|text)\n(.*?)^```$|^!\[[^\]]*\]\(([^)]+)\)$", re.DOTALL | re.MULTILINE)
_TEXT = re.compile(r"^```text\n.*?^```$", re.DOTALL | re.MULTILINE)


def cells(page: Path) -> Iterator[tuple[str, str, str | None, str | None]]:
    """Each cell's language ("python" or "sh") and code, the text that is shown after it and the name of the picture."""
    found = [match.groups() for match in _BLOCK.finditer(page.read_text(encoding="utf-8"))]
    starts = [number for number, (language, _, _) in enumerate(found) if language in ("python", "sh")]
    for start, end in zip(starts, [*starts[1:], len(found)], strict=True):
        text = next((code for language, code, _ in found[start + 1 : end] if language == "text"), None)
        picture = next((name for language, _, name in found[start + 1 : end] if language is None), None)
        yield *found[start][:2], text, picture


def run_cell(code: str, names: dict[str, Any]) -> tuple[str, bytes | None]:
    """Run Python as a notebook does: what it prints, with the last line's value, or the picture that this is."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), names)
        value = None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        if hasattr(value, "_repr_png_"):
            return printed.getvalue(), value._repr_png_()
        if value is not None:
            print(repr(value))
    return printed.getvalue(), None


def run_page(page: Path, command: Callable[..., str]) -> Iterator[tuple[str, str | None, bytes | None, str | None]]:
    """Run a tutorial in the current folder: what each cell prints and should, its picture and that one's name.

    Args: command: runs `obscurance` with arguments and returns what it prints.
    """
    names: dict[str, Any] = {}
    for language, code, text, picture in cells(page):
        if language == "python":
            printed, image = run_cell(code, names)
        else:
            printed = "".join(command(*shlex.split(line)[1:]) for line in code.splitlines())
            image = Path(picture).read_bytes() if picture else None
        yield printed, text, image, picture


def main() -> None:
    for page in PAGES:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            done = list(run_page(page, _command))
        for _, _, image, picture in done:
            if picture and image:
                (page.parent / picture).write_bytes(image)
        printed = (out for out, text, _, _ in done if text is not None)
        shown = page.read_text(encoding="utf-8")
        page.write_text(_TEXT.sub(lambda _, outputs=printed: f"```text\n{next(outputs)}```", shown), encoding="utf-8")


def _command(*arguments: str) -> str:
    line = [sys.executable, str(ROOT / "cli.py"), *arguments]
    done = subprocess.run(line, capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "100"})
    return done.stdout


if __name__ == "__main__":
    main()
