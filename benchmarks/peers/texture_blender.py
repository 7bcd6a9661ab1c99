"""Ambient occlusion as a texture by Blender's own bake (Cycles, CPU) to an image of floats, without margin.

The mesh has `uv`, float32 (3 m, 2), of its corners besides; `normals` are those of the vertices. The bake builds
Cycles' scene anew each time, within `trace`.
"""

import bpy
import numpy as np
from ao_blender import load as load_mesh
from serve import serve_bakes


def load(mesh):
    """Make the mesh Blender's only object, with texture coordinates."""
    load_mesh(mesh)
    coordinates = bpy.context.object.data.uv_layers.new(name="uv")
    coordinates.data.foreach_set("uv", mesh["uv"].ravel())
    return mesh


def build(mesh):
    """Nothing: Cycles builds its scene in the bake."""


def trace(scene, mesh, samples, seed, tau, reach, size):
    if tau:
        raise ValueError("Blender bakes the binary falloff only")
    settings = bpy.context.scene
    settings.cycles.samples, settings.cycles.seed = samples, seed
    settings.world.light_settings.distance = reach
    settings.render.bake.target = "IMAGE_TEXTURES"
    settings.render.bake.margin = 0
    image = bpy.data.images.new("w", size, size, float_buffer=True, is_data=True)
    material = bpy.context.object.data.materials[0]
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.nodes.active = node
    bpy.ops.object.bake(type="AO")
    pixels = np.empty(4 * size * size, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(size, size, 4)[::-1, :, 0]


if __name__ == "__main__":
    serve_bakes(f"bpy {bpy.app.version_string}", build, trace, load)
