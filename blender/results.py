"""w stored in a Blender scene: in a colour attribute, or in an image with its node."""

import bpy
import numpy as np


def store_colours(source, w, name):
    """Store w (c,) of face corners as the active colour attribute, linear; a mesh that others share is copied first."""
    thing = source.thing
    if thing.data.users > 1:
        thing.data = thing.data.copy()
    attributes = thing.data.color_attributes
    if earlier := attributes.get(name):
        attributes.remove(earlier)
    colours = attributes.new(name, "FLOAT_COLOR", "CORNER")
    rgba = np.ones((len(w), 4), np.float32)
    rgba[:, :3] = w[:, None]
    colours.data.foreach_set("color", rgba.ravel())
    attributes.active_color = colours
    thing.data.update()


def store_image(source, path, name):
    """Pack an image into the file, and show it by a node of each material, which no other is linked to yet."""
    thing = source.thing
    title = f"{thing.name} {name}"
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    image.pack()
    if earlier := bpy.data.images.get(title):
        earlier.user_remap(image)
        bpy.data.images.remove(earlier)
    image.name = title
    if not any(slot.material for slot in thing.material_slots):
        thing.data.materials.append(bpy.data.materials.new(thing.name))
    for material in {slot.material for slot in thing.material_slots if slot.material}:
        if material.node_tree is None:
            material.use_nodes = True
        nodes = material.node_tree.nodes
        node = nodes.get(title) or nodes.new("ShaderNodeTexImage")
        node.name = node.label = title
        node.image = image
        nodes.active = node
