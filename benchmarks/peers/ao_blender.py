"""Ambient occlusion at vertices by Blender's own bake (Cycles, CPU) to vertex colours; binary falloff only.

Cycles bakes every face corner; a vertex gets the mean of its corners. It chooses its own ray origins; the points'
normals become the mesh's custom normals. The bake builds Cycles' scene anew each time, within `trace`.
"""

import bpy
import numpy as np
from serve import serve_bakes

LAYER = "w"


def load(mesh):
    """Make the mesh Blender's only object, ready to bake."""
    vertices, faces = mesh["vertices"], mesh["faces"].astype(np.int32)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    triangles = bpy.data.meshes.new("mesh")
    triangles.vertices.add(len(vertices))
    triangles.vertices.foreach_set("co", vertices.ravel())
    triangles.loops.add(faces.size)
    triangles.loops.foreach_set("vertex_index", faces.ravel())
    triangles.polygons.add(len(faces))
    triangles.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    triangles.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
    triangles.update()
    of_vertex = mesh["of_vertex"]
    normals = np.where((of_vertex >= 0)[:, None], mesh["normals"][of_vertex], 0)
    triangles.normals_split_custom_set_from_vertices(normals.tolist())
    triangles.color_attributes.active_color = triangles.color_attributes.new(LAYER, "FLOAT_COLOR", "CORNER")
    triangles.materials.append(bpy.data.materials.new("white"))
    thing = bpy.data.objects.new("mesh", triangles)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    scene.render.engine = "CYCLES"
    scene.render.bake.target = "VERTEX_COLORS"
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    return mesh


def build(mesh):
    """Nothing: Cycles builds its scene in the bake."""


def trace(scene, mesh, samples, seed, tau, reach):
    if tau:
        raise ValueError("Blender bakes the binary falloff only")
    settings = bpy.context.scene
    settings.cycles.samples, settings.cycles.seed = samples, seed
    diagonal = float(np.linalg.norm(np.ptp(mesh["vertices"], axis=0)))
    settings.world.light_settings.distance = min(reach, 1.001 * diagonal)
    bpy.ops.object.bake(type="AO")
    corners = mesh["faces"].ravel()
    colours = np.empty(4 * len(corners), np.float32)
    bpy.context.object.data.color_attributes[LAYER].data.foreach_get("color", colours)
    vertices = len(mesh["vertices"])
    total = np.bincount(corners, colours[::4], vertices)
    return (total / np.maximum(np.bincount(corners, minlength=vertices), 1))[mesh["numbers"]]


if __name__ == "__main__":
    serve_bakes(f"bpy {bpy.app.version_string}", build, trace, load)
