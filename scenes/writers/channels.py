"""Where a mesh file shows w to viewers."""

from __future__ import annotations

from typing import NamedTuple


class Channels(NamedTuple):
    """Where a GLB holds w beside the attribute `_OBSCURANCE`, for viewers.

    Attributes:
        colors: also in `COLOR_0`, linear as glTF's vertex colours are; an existing one is replaced.
        ramp: also in the materials' occlusion textures (`scenes.gltf.ramp`).
        replace: in place of occlusion textures of the source, too.
    """

    colors: bool = False
    ramp: bool = False
    replace: bool = False
