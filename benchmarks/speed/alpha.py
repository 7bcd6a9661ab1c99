"""What alpha costs: a thousand leaf cards over a floor, opaque and with alpha, in turns: bakes, and pictures
with shadows, also of fifteen layers over one another.

python -m benchmarks.speed.alpha
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import OpenImageIO as oiio

from benchmarks import RESULTS
from obscurance import ao
from obscurance.ao.report import versions
from obscurance.raytrace import (
    AlphaSurface,
    AmbientLight,
    Camera,
    DirectionalLight,
    Lambert,
    Mesh,
    Object,
    Opacity,
    Scene,
    Settings,
    Shape,
    Texture,
    render,
)
from obscurance.raytrace.system.atomic import write_json

TARGET = RESULTS / "alpha.json"
CARDS, FLOOR, TEXELS, ROUNDS, SAMPLES, LAYERS = 1000, 65, 256, 5, 256, 15
CAMERA = Camera(position=(0.8, -1.0, 0.9), target=(0, 0, 0.55), up=(0, 0, 1), field_of_view=45)
SETTINGS = Settings(384, 256, samples=4, obscurance="off")
LIGHTS = DirectionalLight(direction=(-0.3, 0.5, -1.0)), AmbientLight(intensity=0.2)
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def leaf(folder: Path) -> Texture:
    """An image whose alpha is that of a round leaf with a soft border, 58 % of the card."""
    across = (np.arange(TEXELS) + 0.5) / TEXELS * 2 - 1
    codes = np.full((TEXELS, TEXELS, 4), 200, np.uint8)
    codes[..., 3] = np.clip((0.86 - np.hypot(across, across[:, None])) * 2000 + 128, 0, 255)
    image = oiio.ImageOutput.create(str(folder / "leaf.png"))
    image.open(str(folder / "leaf.png"), oiio.ImageSpec(TEXELS, TEXELS, 4, "uint8"))
    image.write_image(codes)
    image.close()
    return Texture(folder / "leaf.png")


def foliage(surface: AlphaSurface | None) -> Mesh:
    """Cards of side .12 in a box of side 1 over a floor of side 2."""
    rng = np.random.default_rng(5)
    frames, _ = np.linalg.qr(rng.normal(size=(CARDS, 3, 3)))
    centres = rng.uniform((-0.5, -0.5, 0.1), (0.5, 0.5, 1.1), (CARDS, 3))
    cards = centres[:, None] + 0.06 * np.einsum("kc,nci->nki", CORNERS, frames[:, :2])
    side = np.linspace(-1, 1, FLOOR)
    floor = np.stack([*(axis.ravel() for axis in np.meshgrid(side, side)), np.zeros(FLOOR**2)], axis=-1)
    cells = (FLOOR * np.arange(FLOOR - 1)[:, None] + np.arange(FLOOR - 1)).ravel()[:, None]
    ground = np.concatenate([cells + corners for corners in ([0, 1, FLOOR + 1], [0, FLOOR + 1, FLOOR])])
    faces = (4 * np.arange(CARDS)[:, None, None] + HALVES).reshape(-1, 3)
    opacity = None
    if surface is not None:
        uv = np.zeros((len(faces) + len(ground), 3, 2))
        uv[: len(faces)] = np.tile(((CORNERS + 1) / 2)[HALVES], (CARDS, 1, 1))
        opacity = Opacity(np.repeat([0, -1], [len(faces), len(ground)]), (surface,), uv)
    vertices = np.concatenate([cards.reshape(-1, 3), floor])
    return Mesh(vertices, np.concatenate([faces, ground + 4 * CARDS]), opacity=opacity)


def sheets(surface: AlphaSurface | None) -> Mesh:
    """Squares over one another and over one that is opaque."""
    squares = np.tile(np.column_stack([CORNERS, np.zeros(4)]), (LAYERS + 1, 1))
    squares[:, 2] = 0.05 * np.repeat(np.arange(LAYERS + 1), 4)
    opacity = Opacity(np.repeat([-1, *[0] * LAYERS], 2), (surface,)) if surface else None
    return Mesh(squares, (4 * np.arange(LAYERS + 1)[:, None, None] + HALVES).reshape(-1, 3), opacity=opacity)


def picture_row(meshes: dict[str, Mesh]) -> dict[str, Any]:
    """CPU time of pictures of the meshes, of which the first is opaque, and its multiples."""
    material = Lambert(albedo=0.7, two_sided=True)
    scenes = {name: Scene((Object(Shape(mesh, material)),), LIGHTS) for name, mesh in meshes.items()}
    took: dict[str, list[float]] = {name: [] for name in meshes}
    for _ in range(ROUNDS + 1):
        for name, scene in scenes.items():
            start = time.process_time()
            render(scene, CAMERA, SETTINGS)
            took[name].append(time.process_time() - start)
    seconds = {name: median(each[1:]) for name, each in took.items()}
    ratios = {name: each / next(iter(seconds.values())) for name, each in seconds.items()}
    print("picture      " + "  ".join(f"{name}: {seconds[name]:.3f} s {ratios[name]:.2f}×" for name in meshes))
    return {"seconds": seconds, "ratios": ratios}


def main() -> None:
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        texture = leaf(Path(folder))
        meshes = {
            "opaque": foliage(None),
            "cut out": foliage(AlphaSurface(texture=texture, cutoff=0.5)),
            "blended": foliage(AlphaSurface(0.5, texture)),
        }
        print("falloff      " + "  ".join(f"{name:>16}" for name in meshes) + "   (CPU time, of opaque)")
        for falloff in ("exponential", "binary"):
            took: dict[str, list[float]] = {name: [] for name in meshes}
            for _ in range(ROUNDS + 1):
                for name, mesh in meshes.items():
                    start = time.process_time()
                    ao.bake(mesh, falloff, SAMPLES, denoise=False)
                    took[name].append(time.process_time() - start)
            seconds = {name: median(each[1:]) for name, each in took.items()}
            ratios = {name: each / seconds["opaque"] for name, each in seconds.items()}
            rows.append({"falloff": falloff, "seconds": seconds, "ratios": ratios})
            line = "  ".join(f"{seconds[name]:7.3f} s {ratios[name]:5.2f}×" for name in meshes)
            print(f"{falloff:12} {line}", flush=True)
        meshes["blended at the border"] = foliage(AlphaSurface(texture=texture))
        layered = {"one sheet": sheets(None), f"{LAYERS} layers": sheets(AlphaSurface(0.5))}
        pictures = [picture_row(meshes), picture_row(layered)]
    write_json(TARGET, {"versions": versions(), "rows": rows, "pictures": pictures})


if __name__ == "__main__":
    main()
