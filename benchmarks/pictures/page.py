"""Pages in a headless Chromium that draws in software: size, time to the first picture, FLIP from our own render.

    python -m benchmarks.pictures.page [MESH] [--rounds 5] [--pictures FOLDER]

Without a mesh, of the built-in temple. `--pictures` writes the screenshots of docs/viewing.md instead.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks import ROOT
from benchmarks.pictures.chromium import MISSING, Browser, browser
from obscurance import ao
from obscurance.raytrace import Camera, Mesh, render
from obscurance.raytrace.image.compare import compare
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.mesh.mesh import UP, up_axis
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import write
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.show.look import FIELD_OF_VIEW, clay_scene, clay_settings
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values

_PANEL = 250  # pixels that a page's panel takes
_SIZE = 960, 640
_SMALL = 660, 410


def known(bake: ao.Bake, name: str) -> Values:
    """A bake as a page takes it."""
    return Values(bake.w, bake.error, bake.flags, bake.bent_normals, name=name)


def opened(tab: Browser, page: Path, address: str = "", size: tuple[int, int] = _SIZE) -> None:
    """Open a page and wait until it has drawn."""
    tab.open(page.as_uri() + address, *size)
    tab.wait("document.documentElement.dataset.firstPicture")


def flip(tab: Browser, mesh: Mesh, bake: ao.Bake, folder: Path) -> float:
    """FLIP of a page's first picture from our own of the same view."""
    (folder / "page.png").write_bytes(tab.screenshot("view"))
    tab.run("document.getElementById('view').focus()")
    tab.press("0")
    tab.run("new Promise((done) => setTimeout(done, 300))")
    address = dict(part.split("=") for part in tab.run("location.hash")[1:].split("&"))
    numbers = {name: address[name].split(",") for name in ("position", "target")}
    camera = Camera(**numbers, up=UP[up_axis(mesh)], field_of_view=FIELD_OF_VIEW)
    width, height = _SIZE[0] - _PANEL, _SIZE[1]
    frame = render(clay_scene(mesh, bake.w, camera), camera, clay_settings(width, height), layers=False)
    write_image(folder / "ours.png", frame.layers["beauty"][..., :3])
    return compare(folder / "ours.png", folder / "page.png").flip


def measure(mesh: Mesh, rounds: int) -> None:
    """Print the figures of a mesh's page."""
    bake = ao.bake(mesh, samples=256)
    with tempfile.TemporaryDirectory() as name, browser() as tab:
        folder = Path(name)
        start = time.perf_counter()
        content = html_of_bakes(mesh, [known(bake, mesh.source)], mesh.source)
        written = time.perf_counter() - start
        page = folder / "page.html"
        page.write_bytes(content)
        seconds = []
        for _ in range(rounds):
            opened(tab, page)
            seconds.append(int(tab.run("document.documentElement.dataset.firstPicture")) / 1000)
        away = flip(tab, mesh, bake, folder)
    print(f"{mesh.source}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")
    print(f"page {len(content) / 1e6:.2f} MB, made in {written:.2f} s")
    spread = f"{min(seconds):.2f} to {max(seconds):.2f}"
    print(f"first picture after {statistics.median(seconds):.2f} s (median of {rounds}, {spread})")
    print(f"FLIP from our own render {away:.4f}")
    print(f"messages {tab.messages}")


def take_pictures(folder: Path) -> None:
    """Write the screenshots of docs/viewing.md."""
    folder.mkdir(exist_ok=True)
    mesh = temple()
    bakes = known(ao.bake(mesh), "exponential"), known(ao.bake(mesh, ao.Binary()), "binary")
    with tempfile.TemporaryDirectory() as name, browser() as tab:
        page, both = Path(name) / "temple.html", Path(name) / "both.html"
        page.write_bytes(html_of_bakes(mesh, bakes[:1], "temple.npz"))
        both.write_bytes(html_of_bakes(mesh, bakes, "exponential.npz and binary.npz"))
        for mode in ("clay", "error", "flags"):
            opened(tab, page, f"#mode={mode}&vertex=2000", _SMALL)
            (folder / f"{mode}.png").write_bytes(tab.screenshot())
        opened(tab, both, "#mode=w&split=0.5&scheme=light", _SMALL)
        (folder / "two.png").write_bytes(tab.screenshot())
        report = Path(name) / "report.html"
        write(Path(name) / "temple.ply", ao.bake(mesh, samples=1), Asset.of(mesh))
        line = f"bake temple.ply -o w.npz --up z --tolerance 0.01 --quiet --report {report.name}"
        subprocess.run([sys.executable, ROOT / "cli.py", *line.split()], check=True, cwd=name)
        tab.open(report.as_uri(), 720, 900, dark=False)
        (folder / "report.png").write_bytes(tab.screenshot())


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("mesh", nargs="?", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--pictures", type=Path, help="a folder for the screenshots of docs/viewing.md")
    options = parser.parse_args()
    if MISSING:
        parser.error(MISSING)
    if options.pictures:
        take_pictures(options.pictures)
    elif options.mesh:
        measure(load(options.mesh).mesh, options.rounds)
    else:
        measure(temple(), options.rounds)


if __name__ == "__main__":
    main()
