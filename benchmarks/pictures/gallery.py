"""The pictures of docs/gallery, and docs/temple.png: `python -m benchmarks.pictures.gallery`, part of `make pictures`.

Every built-in scene is written and rendered by the commands that docs/gallery.md shows, which is written too; the
temple is what `obscurance demo` makes. `tests/project/documents/test_docs_pictures.py` says when they are out of date.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import tempfile

from benchmarks import ROOT
from obscurance.scenes.library import BUILTIN

FOLDER = ROOT / "docs" / "gallery"
OPTIONS = {
    "plane_wall": ("--width", "640", "--height", "400"),
    "cornell": ("--width", "480", "--height", "480"),
    "temple": ("--width", "640", "--height", "400"),
    "sponge": ("--width", "640", "--height", "427"),
    "materials": ("--width", "640", "--height", "400"),
    "metals": ("--width", "560", "--height", "350"),
    "still_life": ("--width", "640", "--height", "400"),
}
MORE = {
    "faces": ("openness of vertices, and of faces", "obscurance bake temple.ply -o faces.ply --at faces"),
    "shell": (
        "both sides of an opened shell, and without what nobody sees",
        "obscurance prune engine.glb -o shell.glb",
    ),
    "points": ("clouds of 40,000 and 400,000 points", "obscurance bake scan.ply -o scan-w.ply --points"),
}
"""Strips of `benchmarks.pictures.elements`, and the command that makes such a thing."""
HEAD = """\
# Gallery

The built-in scenes, each made by the two lines below it. `make pictures` makes them all again.
"""


def commands(name: str) -> tuple[list[str], list[str]]:
    """What writes a built-in scene, and what renders it."""
    scene = f"{name}.toml"
    return (
        ["obscurance", "scenes", name, "-o", scene],
        ["obscurance", "render", scene, "-o", f"{name}.png", *OPTIONS.get(name, OPTIONS["temple"])],
    )


def page() -> str:
    """The text of docs/gallery.md."""
    text = HEAD
    for name, summary in BUILTIN.items():
        code = "\n".join(shlex.join(command) for command in commands(name))
        text += f"\n## {name}: {summary}\n\n![{name}](gallery/{name}.png)\n\n```sh\n{code}\n```\n"
    text += "\n## More\n\nDrawn by `python -m benchmarks.pictures.elements`.\n"
    for name, (summary, code) in MORE.items():
        text += f"\n![{name}](gallery/{name}.png)\n\n*{summary.capitalize()}*\n\n```sh\n{code}\n```\n"
    return (
        text
        + "\n![soft shadows](gallery/soft_shadows.png)\n\n*A hard light, and `radius` .15 and .5 in `[[lights]]`*\n"
    )


def run(command: list[str], folder: str) -> None:
    """Run an `obscurance` command in a folder."""
    subprocess.run([sys.executable, str(ROOT / "cli.py"), *command[1:]], cwd=folder, check=True)


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in BUILTIN:
            for command in commands(name):
                run(command, folder)
            shutil.copy(f"{folder}/{name}.png", FOLDER)
        run(["obscurance", "demo"], folder)
        shutil.copy(f"{folder}/demo/temple.png", ROOT / "docs")
    (ROOT / "docs" / "gallery.md").write_text(page())


if __name__ == "__main__":
    main()
