"""What Blender has of files after importing them, as JSON on the last line; arguments are their names."""

import json
import sys
from pathlib import Path

import bpy

SIDE = 24


def values(thing, name):
    """Of an attribute, linear whatever is stored, or None."""
    attribute = thing.data.attributes.get(name)
    if attribute is None:
        return None
    return [each.color[0] if "COLOR" in attribute.data_type else each.value for each in attribute.data]


def brightness(folder):
    """The mean of a picture of the unit square from above in an even white light."""
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("white")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.0
    scene.camera.location = 0.5, 0.5, 9.0
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 16
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(folder / "seen.exr")
    bpy.ops.render.render(write_still=True)
    pixels = bpy.data.images.load(scene.render.filepath).pixels[:]
    return sum(pixels[::4]) / SIDE**2


def imported(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    importer = bpy.ops.wm.ply_import if path.suffix == ".ply" else bpy.ops.import_scene.gltf
    importer(filepath=str(path))
    (thing,) = (each for each in bpy.data.objects if each.type == "MESH")
    return {
        "places": [list(thing.matrix_world @ vertex.co) for vertex in thing.data.vertices],
        "corners": [loop.vertex_index for loop in thing.data.loops],
        "brightness": brightness(path.parent) if path.suffix == ".glb" else None,
        **{name: values(thing, name) for name in ("_OBSCURANCE", "obscurance", "Color", "Col")},
    }


found = [imported(Path(name)) for name in sys.argv[1:]]
print("\n" + json.dumps(found))
