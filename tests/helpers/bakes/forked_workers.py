"""Imported by the process of which workers are forks: what they use, which would take each of them two seconds."""

import distributed.nanny

import ao.baking
import ao.cluster.worker
import ao.texture.bake_texture
import raytrace.renderer.render
from ao.execute.work import bit_environment

__all__ = ["ao", "distributed", "raytrace"]
bit_environment()  # a hash of all sources, made once
