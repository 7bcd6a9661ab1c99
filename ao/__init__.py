"""Ambient occlusion and obscurance, baked at the vertices of a mesh."""

from .bake import Bake, bake
from .falloff import Binary, Exponential, Falloff
from .receivers import Flag
from .surface import bake_surface
from .tolerance import ToleranceWarning

__all__ = ["Bake", "Binary", "Exponential", "Falloff", "Flag", "ToleranceWarning", "bake", "bake_surface"]
