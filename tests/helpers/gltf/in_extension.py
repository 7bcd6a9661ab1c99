"""Bakes of the extension within Blender; prints what they leave as JSON. Arguments: its folder, and the command."""

import importlib.util
import json
import shutil
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

folder, command = sys.argv[1:]
name = "obscurance_extension"
found = importlib.util.spec_from_file_location(name, f"{folder}/__init__.py", submodule_search_locations=[folder])
extension = sys.modules[name] = importlib.util.module_from_spec(found)
found.loader.exec_module(extension)
bpy.ops.wm.read_factory_settings(use_empty=True)
extension.register()
bpy.context.preferences.addons.new().module = name
bpy.context.preferences.addons[name].preferences.command = command
tempfile.tempdir = str(Path(command).parent)


def select(*things):
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[0]


def bake(**options):
    """Bake with these options; the status, or the error."""
    try:
        return next(iter(bpy.ops.object.bake_obscurance(**options)))
    except RuntimeError as fault:
        return str(fault).strip()


def corners(thing):
    """Places of the corners, their normals, and w."""
    mesh = thing.data
    colours = np.empty(4 * len(mesh.loops), np.float32)
    mesh.color_attributes["Obscurance"].data.foreach_get("color", colours)
    matrix = thing.matrix_world
    turn = matrix.to_3x3().inverted().transposed()
    return {
        "places": [list(matrix @ mesh.vertices[loop.vertex_index].co) for loop in mesh.loops],
        "faces": [list(triangle.loops) for triangle in mesh.loop_triangles],
        "normals": [list((turn @ normal.vector).normalized()) for normal in mesh.corner_normals],
        "w": colours.reshape(-1, 4)[:, 0].tolist(),
    }


bpy.ops.mesh.primitive_monkey_add(size=2, rotation=(0.3, 0.2, 1.0))
monkey = bpy.context.object
monkey.scale = (-1, 1, 1.5)
bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1.5))
plane = bpy.context.object
bpy.context.view_layer.update()
select(monkey)
answers = {"alone": bake(falloff="binary", others=False)}
answers["monkey"] = corners(monkey)
answers["among"] = bake(falloff="binary")
answers["among w"] = corners(monkey)["w"]
select(plane)
answers["image"] = bake(target="IMAGE", size=64, falloff="binary")
image = bpy.data.images["Plane Obscurance"]
answers["pixels"] = np.array(image.pixels[:]).reshape(64, 64, -1)[:, :, 0].tolist()
answers["node"] = plane.data.materials[0].node_tree.nodes["Plane Obscurance"].image == image
monkey.modifiers.new("smooth", "SUBSURF")
select(monkey)
answers["modified"] = bake()
answers["wrong"] = bake(target="IMAGE", half_distance="x")
operator = SimpleNamespace(
    _sources=extension.collect(bpy.context, True, True),
    cancel=lambda context: extension.BakeObscurance.cancel(operator, context),
    _end=lambda context: None,
    report=lambda kinds, text: None,
)
operator._job = extension.Job(command, operator._sources, ["--size", "2048", "--tolerance", "0.0001"])
for key in ("X", "LEFTMOUSE", "MIDDLEMOUSE", "ESC"):
    event = SimpleNamespace(type=key)
    answers[key] = next(iter(extension.BakeObscurance.modal(operator, bpy.context, event)))
answers["panel"] = "REGISTER" in extension.BakeObscurance.bl_options
monkey.modifiers.clear()
answers["long"] = bake(name=80 * "x")
preferences = bpy.context.preferences.addons[name].preferences
preferences.command = shutil.which("true")
answers["nothing"] = bake()
Path(command).write_text("no program")
preferences.command = command
answers["no program"] = bake()
monkey.data.vertices[0].co.x = float("nan")
answers["nan"] = bake()
answers["left"] = [path.name for path in Path(command).parent.glob("obscurance-*")]
extension.unregister()
print("\n" + json.dumps(answers))
