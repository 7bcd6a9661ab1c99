"""The pictures of docs/gallery: `python -m benchmarks.gallery`, or `make gallery`.

Every built-in scene is written and rendered by the commands that docs/gallery.md shows, which is written too.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from scenes.builtin import BUILTIN

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "docs" / "gallery"
OPTIONS = {
    "plane_wall": ("--width", "640", "--height", "400"),
    "cornell": ("--width", "480", "--height", "480"),
    "temple": ("--width", "640", "--height", "400"),
    "sponge": ("--width", "640", "--height", "427"),
    "materials": ("--width", "640", "--height", "400"),
    "still_life": ("--width", "640", "--height", "400"),
}
HEAD = """\
# Gallery

The built-in scenes, each made by the two lines below it. `make gallery` makes them all again.
"""


def commands(name: str) -> tuple[list[str], list[str]]:
    """What writes a built-in scene, and what renders it."""
    scene = f"{name}.toml"
    return (
        ["obscurance", "scenes", name, "-o", scene],
        ["obscurance", "render", scene, "-o", f"{name}.png", *OPTIONS.get(name, OPTIONS["temple"])],
    )


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    text = HEAD
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in BUILTIN.items():
            shown = []
            for command in commands(name):
                line = [sys.executable, str(ROOT / "cli.py"), *command[1:]]
                subprocess.run(line, cwd=folder, check=True)
                shown.append(shlex.join(command))
            picture = f"{name}.png"
            (FOLDER / picture).write_bytes((Path(folder) / picture).read_bytes())
            code = "\n".join(shown)
            text += f"\n## {name}: {scene.summary}\n\n![{scene.summary}](gallery/{picture})\n\n```sh\n{code}\n```\n"
    (ROOT / "docs" / "gallery.md").write_text(text)


if __name__ == "__main__":
    main()
