"""Imported by the process of which workers are forks: what they use, which would take each of them two seconds."""

import distributed.nanny

import obscurance.ao.baking
import obscurance.ao.cluster.workers
import obscurance.ao.texture.bake_texture
import obscurance.raytrace.renderer.render
from obscurance.ao.execute.work import bit_environment

__all__ = ["distributed", "obscurance"]
bit_environment()  # a hash of all sources, made once
