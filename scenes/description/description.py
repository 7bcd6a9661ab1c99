"""The content of a scene file: scene, camera, settings, and the source of its obscurance."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import ao
from raytrace.camera import Camera
from raytrace.scene import Scene
from raytrace.settings import Settings

from ..geometry.primitives import Origin


@dataclass(frozen=True)
class BakeOptions:
    """Where w(p) comes from.

    Attributes:
        source: "bake" it for this picture, "off" (w = 1), or a file of `obscurance bake` with one value a vertex of
            `Scene.flattened()`: `.npy`, `.npz`, `.ply`, `.glb`, `.gltf`.
        falloff: μ of a bake.
        samples: rays a vertex of a bake, 1 to 2²⁰.
        seed: of a bake, 0 to 2⁶⁴ − 1.
    """

    source: Literal["bake", "off"] | Path = "bake"
    falloff: ao.Falloff = field(default_factory=ao.Exponential)
    samples: int = 256
    seed: int = 0


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A scene file's content.

    Attributes:
        scene: objects, lights and background; no object has its w yet.
        camera: the file's own, or one that frames everything.
        settings: of the picture.
        bake: of w(p); its source is "off" exactly when `settings.obscurance` is.
        files: every file that the scene is made of: its own, meshes, textures, w.
        notes: warnings about them.
        origins: of the vertices of each object, None where they are its file's one by one; or nothing, if all are.
    """

    scene: Scene
    camera: Camera
    settings: Settings = field(default_factory=Settings)
    bake: BakeOptions = field(default_factory=BakeOptions)
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    origins: tuple[Origin | None, ...] = ()
