"""Obscurance as vertex properties of a binary PLY file: of a mesh in memory, or of one on the disk in runs of rows."""

from dataclasses import replace

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.mesh.mesh import Mesh, up_axis
from obscurance.raytrace.mesh.normals import face_normals

from ...geometry.attributes import Element, Property, SourceAttributes, float_normals, triangle_attributes
from ..load import MeshFile
from ..table import Channels
from . import layout
from .layout import COUNT, RGB, UP_COMMENT, grey_of, is_profile, own_colors, stored_colors

OWN = "comment obscurance: 1 = open"
GREY = "; red green blue = obscurance as sRGB"
_COMMENTS = {"": "", "rgb": GREY, "a": "; alpha = obscurance"}
MESHLAB = "quality"  # the property that MeshLab shows
_COMMENTS |= {name[0]: f"; {name} = obscurance as sRGB" for name in RGB}


def ply(bake: Bake, mesh_file: MeshFile, channels: Channels) -> bytes:
    """A PLY file with the float property `obscurance`, and grey `red green blue`, w as sRGB, where that replaces
    nothing. A profile becomes obscurance_00, …, and a comment with the radius and the half-distances.

    A PLY source keeps all its elements, properties, polygons and comments, of others the polygons, normals, colours
    and texture coordinates are kept (`s t` of vertices, or `texcoord` of faces where a vertex has several).

    `channels.ply_name` is another property with w; where it is MeshLab's, see `cuts_polygons`. With `channels.colors`
    "rgb" the grey also replaces the source's own colours; with one letter w replaces only that channel. A comment says
    which axis but y is up.
    """
    attributes = mesh_file.held
    profile = bake.profile
    elements = attributes.elements or _elements(mesh_file.mesh, attributes)
    cut = channels.ply_name == MESHLAB and cuts_polygons(mesh_file)
    if cut:
        elements = tuple(_cut(element, attributes) if element.name == "face" else element for element in elements)
    colour_channels = channels.colors or ("" if has_own_colors(attributes) else "rgb")
    # Comments: the axis that is up, what the grey is, and the profile's distances.
    axis = up_axis(mesh_file.mesh, channels.up)
    comments = [line for line in attributes.comments if not line.startswith(UP_COMMENT) or line == UP_COMMENT + axis]
    if axis != "y" and UP_COMMENT + axis not in comments:
        comments.insert(0, UP_COMMENT + axis)
    comments.insert(0, OWN + _COMMENTS[colour_channels])
    if profile:
        words = [*map(repr, [profile.radius, *profile.half_distances.tolist()])]
        words += ["max_distance", repr(profile.max_distance)] if "max_distance" in profile.lengths else []
        comments.insert(1, layout.PROFILE_COMMENT + " ".join(words))
    # The elements, with w in that of vertices or of faces.
    further = channels.ply_name
    named = "face" if bake.at == "faces" else "vertex"
    values = _of_polygons(bake, mesh_file) if bake.at == "faces" and not cut else bake
    fitting = []
    for element in elements:
        annotated = _annotate(element, values, colour_channels, further) if element.name == named else element
        fitting.append(replace(element, properties=tuple(column.fitting() for column in annotated.properties)))
    return b"".join([layout.write_header(fitting, comments), *map(_rows, fitting)])


def bare_ply(mesh: Mesh) -> bytes:
    """A PLY file of the vertices and faces alone, in double where float does not hold them."""
    elements = _elements(mesh, triangle_attributes(mesh.faces))
    return b"".join([layout.write_header(elements, []), *map(_rows, elements)])


def has_own_colors(attributes: SourceAttributes) -> bool:
    """Whether the source has vertex colours that are not the grey of an earlier bake."""
    return bool(own_colors(attributes.elements)) or (attributes.colors is not None and not attributes.elements)


def cuts_polygons(mesh_file: MeshFile) -> bool:
    """Whether polygons for MeshLab become triangles: it opens none that have lists of texture coordinates."""
    held = mesh_file.held
    if held.uv is None or (held.sizes == 3).all():
        return False
    if held.elements:
        return "texcoord" in layout.columns_of(held.elements, "face", lists=True)
    has_all = bool(np.isfinite(held.uv.values).all())
    return has_all and held.uv.at_vertices(held.corners, len(mesh_file.mesh.vertices)) is None


def _cut(element: Element, attributes: SourceAttributes) -> Element:
    """The element of faces with its polygons as triangles: lists of one value or pair a corner, and single values."""
    triangles, sizes = attributes.triangles, attributes.sizes
    columns = []
    for column in element.properties:
        wide = len(column.values) // max(len(attributes.corners), 1)
        if not column.counted:
            columns.append(column._replace(values=np.repeat(column.values, triangles.counts)))
        elif wide and np.array_equal(column.sizes, wide * sizes):
            places = triangles.take(np.arange(len(attributes.corners))).ravel()
            values = column.values.reshape(-1, wide)[places].ravel()
            columns.append(column._replace(values=values, sizes=np.full(int(triangles.counts.sum()), 3 * wide)))
    return Element(element.name, int(triangles.counts.sum()), tuple(columns))


def _of_polygons(bake: Bake, mesh_file: MeshFile) -> Bake:
    """w of the polygons that the faces of a bake were cut from: the mean by area. Its profile is left out."""
    polygon = mesh_file.held.triangles.polygons
    if polygon is None:
        return replace(bake, profile=None)
    areas = np.maximum(face_normals(bake.mesh.vertices, bake.mesh.faces)[1], 1e-300)
    w = np.bincount(polygon, areas * bake.w) / np.bincount(polygon, areas)
    below = bake.below and _of_polygons(bake.below, mesh_file)
    return replace(bake, w=w, below=below, profile=None)


def _annotate(element: Element, bake: Bake, colour_channels: str, further: str | None) -> Element:
    """The vertices' element with w, and what else a bake has, in place of an earlier bake's.

    Args:
        colour_channels: channels of colours that hold w, "" for none.
        further: the name of a second property of w.
    """
    replaced = (
        "obscurance",
        further,
        *(RGB if colour_channels else ()),
        *(("alpha",) if len(colour_channels) == 1 else ()),
    )
    unchanged = [column for column in element.properties if column.name not in replaced and not is_profile(column.name)]
    added = [Property(name, "f", bake.w.astype("<f4")) for name in filter(None, ("obscurance", further))]
    if bake.below:
        added.append(Property("obscurance_below", "f", bake.below.w.astype("<f4")))
    if bake.profile:
        columns = enumerate(bake.profile.values.T)
        added += [Property(f"{layout.PROFILE}{number:02}", "f", column.astype("<f4")) for number, column in columns]
    if len(colour_channels) == 1:
        added += layout.with_channel(bake.w, colour_channels, stored_colors((element,)))
    elif colour_channels:
        grey = grey_of(bake.w)
        added += [Property(name, "B", grey) for name in RGB]
    return replace(element, properties=(*unchanged, *added))


def _elements(mesh: Mesh, attributes: SourceAttributes) -> tuple[Element, ...]:
    """Elements of a mesh that was no PLY: vertices, and faces with what another format's attributes hold."""
    # Coordinates and normals.
    columns = [Property(axis, "f", mesh.vertices[:, number]).fitting() for number, axis in enumerate("xyz")]
    if any(column.kind == "d" for column in columns):
        columns = [column._replace(kind="d") for column in columns]
    if mesh.normals is not None:
        normals = float_normals(mesh.normals)
        columns += [Property(axis, "f", column) for axis, column in zip(("nx", "ny", "nz"), normals.T, strict=True)]
    # Polygons, texture coordinates and colours of another format.
    sizes = attributes.sizes
    corners = attributes.corners
    lists = []
    if attributes.uv and np.isfinite(attributes.uv.values).all():
        uv = attributes.uv.at_vertices(corners, len(mesh.vertices))
        if uv is None:
            uv = attributes.uv.values[attributes.uv.of]
            lists = [Property("texcoord", "f", uv.astype("<f4").ravel(), "B", 2 * sizes)]
        else:
            columns += [Property(name, "f", uv[:, n].astype("<f4")) for n, name in enumerate("st")]
    if attributes.colors is not None:
        whole = np.rint(np.clip(np.nan_to_num(attributes.colors), 0, 1) * 255)
        columns += [Property(name, "B", column) for name, column in zip((*RGB, "alpha"), whole.T, strict=False)]
    faces = Property("vertex_indices", "i", corners, "B", sizes)
    return Element("vertex", len(mesh.vertices), tuple(columns)), Element("face", len(sizes), (faces, *lists))


def _rows(element: Element) -> memoryview:
    """The rows of an element: as an array where their lists are equally long, or else column by column."""
    lists = {column.name: column.sizes for column in element.properties if column.counted}
    if all((sizes == sizes[:1]).all() for sizes in lists.values()):
        lengths = {name: int(sizes[0]) if len(sizes) else 0 for name, sizes in lists.items()}
        table = np.empty(element.count, layout.row_of(element, lengths))
        for column in element.properties:
            table[column.name] = column.values.reshape(table[column.name].shape)
            if column.counted:
                table[COUNT + column.name] = lengths[column.name]
        return table.view(np.uint8).data
    # Lists of different lengths: the values of each column are scattered to where their rows begin.
    one_each = np.ones(element.count, np.int64)
    columns = []
    for column in element.properties:
        if column.counted:
            columns.append((column.sizes.astype("<" + column.counted), one_each))
        columns.append((column.values.astype("<" + column.kind), column.sizes if column.counted else one_each))
    widths = sum((values.itemsize * sizes for values, sizes in columns), start=0 * one_each)
    data = np.empty(int(widths.sum()), np.uint8)
    starts = np.cumsum(widths) - widths
    for values, sizes in columns:
        first_bytes = starts - values.itemsize * (np.cumsum(sizes) - sizes)
        byte_offsets = np.repeat(first_bytes, sizes) + values.itemsize * np.arange(len(values))
        for byte, part in enumerate(values.view(np.uint8).reshape(-1, values.itemsize).T):
            data[byte_offsets + byte] = part
        starts += values.itemsize * sizes
    return data.data
