"""A unit square over a floor, whose materials have alpha, for the tests: vertices, form factors, files."""

import numpy as np
import PIL.Image
from gltf_files import Builder
from gltf_samples import encoded, with_images
from meshes import grid

from obscurance.ao.closed_forms import polygon_form_factor

HEIGHT, UP = 0.4, np.array([0.0, 0.0, 1.0])
FLOOR, FLOOR_FACES = grid(4, 1.8)
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def leaf_codes(alpha=1.0):
    """An image (64, 64, 4) of this alpha, whose right half is empty."""
    codes = np.full((64, 64, 4), 200, np.uint8)
    codes[..., 3] = round(255 * alpha)
    codes[:, 32:, 3] = 0
    return codes


def form_factors(height=HEIGHT, half=0.5, right=None):
    """Of a square over each vertex of the floor, cut off at x = `right`."""
    square = np.column_stack([2 * half * SQUARE, np.full(4, height)])
    square[:, 0] = np.minimum(square[:, 0], np.inf if right is None else right)
    return np.array([polygon_form_factor(square, point, UP) for point in FLOOR])


def card_glb(material, image=None, colours=None, uv=SQUARE + 0.5, image_fields=None, **node):
    """A GLB of the floor and the card. Args: uv: v upwards. image: codes of the base colour texture, number 0."""
    builder = Builder()
    card = np.column_stack([SQUARE, np.full(4, HEIGHT)]).astype("<f4")
    primitive = builder.primitive(card, HALVES, material=0)
    coordinates = np.column_stack([uv[:, 0], 1 - uv[:, 1]]).astype("<f4")
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(coordinates, "VEC2")
    if colours is not None:
        primitive["attributes"]["COLOR_0"] = builder.accessor(np.asarray(colours, "<f4"), "VEC4")
    builder.mesh(builder.primitive(FLOOR.astype("<f4"), FLOOR_FACES))
    builder.mesh(primitive)
    fields = {} if image is None else with_images(builder, encoded(image)) | (image_fields or {})
    return builder.glb([{"mesh": 0}, {"mesh": 1, **node}], materials=[material], **fields)


def card_obj(folder, material, image=None):
    """An OBJ of the floor and the card, with its library and leaf.png. Returns: its path."""
    rows = [f"v {x} {y} {z}" for x, y, z in FLOOR] + [f"v {x} {y} {HEIGHT}" for x, y in SQUARE]
    rows += [f"vt {u} {v}" for u, v in SQUARE + 0.5] + ["usemtl floor"]
    rows += ["f " + " ".join(f"{i + 1}/1" for i in face) for face in FLOOR_FACES]
    rows += ["usemtl leaf", "f 26/1 27/2 28/3 29/4"]
    (folder / "card.obj").write_text("mtllib card.mtl\n" + "\n".join(rows) + "\n")
    (folder / "card.mtl").write_text(f"newmtl floor\nKd 1 1 1\nnewmtl leaf\n{material}\n")
    if image is not None:
        PIL.Image.fromarray(image).save(folder / "leaf.png")
    return folder / "card.obj"
