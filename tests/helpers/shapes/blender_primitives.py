"""Write `blender_primitives.npz`, meshes and layouts as Blender makes them: `pip install bpy==5.0.1`, then this script.

Arrays NAME_vertices float32 (n, 3), NAME_faces uint16 (m, 3), of triangles, and NAME_uv float32 (m, 3, 2) by corner.
"""

from pathlib import Path

import bpy
import numpy as np

ADD = bpy.ops.mesh
PRIMITIVES = {
    "cube": lambda: ADD.primitive_cube_add(),
    "uv_sphere": lambda: ADD.primitive_uv_sphere_add(),
    "ico_sphere": lambda: ADD.primitive_ico_sphere_add(),
    "cone": lambda: ADD.primitive_cone_add(),
    "cylinder": lambda: ADD.primitive_cylinder_add(),
    "torus": lambda: ADD.primitive_torus_add(),
    "grid": lambda: ADD.primitive_grid_add(),
}

arrays = {}
for name, add in PRIMITIVES.items():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add()
    mesh = bpy.context.object.data
    mesh.calc_loop_triangles()
    corners = np.array([triangle.loops[:] for triangle in mesh.loop_triangles])
    uv = np.array([each.uv[:] for each in mesh.uv_layers[0].data], np.float32)
    arrays[f"{name}_vertices"] = np.array([vertex.co[:] for vertex in mesh.vertices], np.float32)
    arrays[f"{name}_faces"] = np.array([triangle.vertices[:] for triangle in mesh.loop_triangles], np.uint16)
    arrays[f"{name}_uv"] = uv[corners]
np.savez_compressed(Path(__file__).with_suffix(".npz"), **arrays)
