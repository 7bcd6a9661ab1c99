"""The content of a scene file: scene, camera, settings, and the source of its obscurance."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from ao.options import Options
from raytrace import Camera, Scene, Settings

from ..falloffs import Scales
from ..geometry.primitives import Origin

Source = Literal["bake", "off"] | Path


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A scene file's content.

    Attributes:
        scene: objects, lights and background; no object has its w yet.
        camera: the file's own, or one that frames everything.
        settings: of the picture.
        w_from: where w(p) comes from: "bake" it for this picture; "off" (w = 1), exactly when `settings.obscurance` is;
            or a file of `obscurance bake` with one value a vertex of `Scene.flattened()`: `.npy`, `.npz`, `.ply`,
            `.glb`, `.gltf`.
        scales: of the file's profile, in place of its w.
        bake: falloff, samples and seed of a bake.
        files: every file that the scene is made of: its own, meshes, textures, w.
        notes: warnings about them.
        origins: of the vertices of each object, None where they are its file's one by one; or nothing, if all are.
    """

    scene: Scene
    camera: Camera
    settings: Settings = field(default_factory=Settings)
    w_from: Source = "bake"
    bake: Options = field(default_factory=Options)
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    origins: tuple[Origin | None, ...] = ()
    scales: Scales | None = None
