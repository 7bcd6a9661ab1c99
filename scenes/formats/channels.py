"""Where an output shows w to viewers, and how."""

from __future__ import annotations

from typing import NamedTuple


class Channels(NamedTuple):
    """Where a GLB holds w beside the attribute `_OBSCURANCE`, for viewers, and how a page stands.

    Attributes:
        colors: also in `COLOR_0`, linear as glTF's vertex colours are; an existing one is replaced.
        ramp: also in the materials' occlusion textures (`scenes.formats.glb.ramp`).
        replace: in place of occlusion textures of the source, too.
        up: the axis that is up, in place of `Mesh.up`.
    """

    colors: bool = False
    ramp: bool = False
    replace: bool = False
    up: str | None = None
