"""Obscurance as vertex properties of a binary PLY file: of a mesh in memory, or of one on the disk in runs of rows."""

from dataclasses import replace

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.mesh.mesh import Mesh, up_axis
from obscurance.raytrace.mesh.normals import face_areas, normalize
from obscurance.raytrace.types import AnyFloats, Float64s

from ...asset.asset import Asset
from ...asset.primitive import BAKED, W, float_normals, known_columns, own_colours
from ..table import Channels
from . import layout
from .layout import COUNT, INDICES, RGB, UP_COMMENT, Element, Ply, Property, grey_of, stored_colors

GREY = "; red green blue = obscurance as sRGB"
_COMMENTS = {"": "", "rgb": GREY, "a": "; alpha = obscurance"}
MESHLAB = "quality"  # the property that MeshLab shows
_COMMENTS |= {name[0]: f"; {name} = obscurance as sRGB" for name in RGB}


def ply(bake: Bake, asset: Asset, channels: Channels) -> bytes:
    """A PLY file with the float property `obscurance`, and grey `red green blue`, w as sRGB, where that replaces
    nothing. Error, flags (uchar) and bent normals are properties too, as far as they are known, by the names of `BAKED`
    and `AXES`. A profile becomes obscurance_00, …, and a comment with the radius and the half-distances.

    A PLY source keeps all its elements, properties, polygons and comments, of others the polygons, normals, colours
    and texture coordinates are kept (`s t` of vertices, or `texcoord` of faces where a vertex has several).

    `channels.ply_name` is another property with w; where it is MeshLab's, see `cuts_polygons`. With `channels.colors`
    "rgb" the grey also replaces the source's own colours; with one letter w replaces only that channel. A comment says
    which axis but y is up.
    """
    raw = asset.raw if isinstance(asset.raw, Ply) else None
    profile = bake.profile
    elements = raw.elements if raw else _elements(asset)
    cut = channels.ply_name == MESHLAB and cuts_polygons(asset)
    if cut:
        elements = tuple(_cut(element, asset) if element.name == "face" else element for element in elements)
    if channels.ply_name == MESHLAB:
        elements = tuple(_of_int(element) if element.name == "face" else element for element in elements)
    colour_channels = channels.colors or ("" if has_own_colors(asset) else "rgb")
    # Comments: the axis that is up, what the grey is, and the profile's distances.
    axis = up_axis(asset.mesh, channels.up)
    stored = raw.comments if raw else ()
    comments = [line for line in stored if not line.startswith(UP_COMMENT) or line == UP_COMMENT + axis]
    if axis != "y" and UP_COMMENT + axis not in comments:
        comments.insert(0, UP_COMMENT + axis)
    comments.insert(0, f"{layout.OWN}1 = open" + _COMMENTS[colour_channels])
    if profile:
        words = [*map(repr, [profile.radius, *profile.half_distances.tolist()])]
        words += ["max_distance", repr(profile.max_distance)] if "max_distance" in profile.lengths else []
        comments.insert(1, layout.PROFILE_COMMENT + " ".join(words))
    if channels.record:
        comments.insert(1, layout.RECORD_COMMENT + channels.record)
    # The elements, with w in that of vertices or of faces.
    further = channels.ply_name
    named = "face" if bake.at == "faces" else "vertex"
    values = _of_polygons(bake, asset) if bake.at == "faces" and not cut else bake
    fitting = [
        (_annotate(element, values, colour_channels, further) if element.name == named else element).fitting
        for element in elements
    ]
    return b"".join([layout.write_header(fitting, comments), *map(_rows, fitting)])


def bare_ply(mesh: Mesh) -> bytes:
    """A PLY file of the vertices and faces alone, in double where float does not hold them."""
    elements = _elements(Asset.of(mesh))
    return b"".join([layout.write_header(elements, []), *map(_rows, elements)])


def has_own_colors(asset: Asset) -> bool:
    """Whether the source has vertex colours, or a PLY some of the three, that are not the grey of an earlier bake."""
    if isinstance(asset.raw, Ply):
        some = {*RGB} & stored_colors(asset.raw.elements).keys()
        if len(some) < len(RGB):
            return bool(some)
        if asset.cloud:  # the parts are its discs
            return bool(own_colours(layout.ply_columns(asset.raw.elements, asset.sizes)))
    return any(part.primitive.own_colours for part in asset.parts)


def cuts_polygons(asset: Asset) -> bool:
    """Whether polygons for MeshLab become triangles: it opens none that have lists of texture coordinates, and of more
    than 255 corners a part."""
    if (asset.sizes > 255).any():
        return True
    uv = asset.of_polygons("uv0", missing=(0, 1))
    if uv is None or (asset.sizes == 3).all():
        return False
    if isinstance(asset.raw, Ply):
        return "texcoord" in layout.columns_of(asset.raw.elements, "face", lists=True)
    return bool(np.isfinite(uv.values).all()) and uv.at_vertices(asset.corners, len(asset.mesh.vertices)) is None


def _cut(element: Element, asset: Asset) -> Element:
    """The element of faces with its polygons as triangles: lists of one value or pair a corner, and single values."""
    triangles, sizes, count = asset.triangles, asset.sizes, len(asset.corners)
    columns = []
    for column in element.properties:
        wide = len(column.values) // max(count, 1)
        if not column.counted:
            columns.append(column._replace(values=np.repeat(column.values, triangles.counts)))
        elif wide and np.array_equal(column.sizes, wide * sizes):
            places = triangles.take(np.arange(count)).ravel()
            values = column.values.reshape(-1, wide)[places].ravel()
            columns.append(column._replace(values=values, sizes=np.full(int(triangles.counts.sum()), 3 * wide)))
    return Element(element.name, int(triangles.counts.sum()), tuple(columns))


def _of_int(element: Element) -> Element:
    """The element of faces with its vertices as `uchar int vertex_indices`: MeshLab opens no list with a count of
    uint, ushort or short, nor one of ushort, uchar or, by the other usual name, uint."""
    lists = [column.name for column in element.properties if column.counted]
    used = next((name for name in INDICES if name in lists), None)
    columns = (
        column._replace(name=INDICES[0], kind="i", counted="B", values=column.values.astype(np.int32))
        if column.counted and column.name == used
        else column
        for column in element.properties
    )
    return replace(element, properties=tuple(columns))


def _of_polygons(bake: Bake, asset: Asset) -> Bake:
    """A bake of the polygons that its faces were cut from: means by area, all flags. Its profile is left out."""
    polygon = asset.triangles.polygons
    if polygon is None:
        return replace(bake, profile=None)
    areas = np.maximum(face_areas(bake.mesh.vertices, bake.mesh.faces), 1e-300)
    count = len(asset.sizes)
    whole = np.maximum(np.bincount(polygon, areas, count), 1e-300)

    def mean(values: AnyFloats) -> Float64s:
        return np.bincount(polygon, areas * values, count) / whole

    below = bake.below and _of_polygons(bake.below, asset)
    bent = normalize(np.stack([mean(column) for column in bake.bent_normals.T], axis=1))
    flags = np.zeros(count, np.uint8)
    np.bitwise_or.at(flags, polygon, bake.flags)
    return replace(
        bake, w=mean(bake.w), error=mean(bake.error), bent_normals=bent, flags=flags, below=below, profile=None
    )


def _annotate(element: Element, bake: Bake, colour_channels: str, further: str | None) -> Element:
    """The vertices' element with w, and what else a bake has, in place of an earlier bake's.

    Args:
        colour_channels: channels of colours that hold w, "" for none.
        further: the name of a second property of w.
    """
    colours = (*RGB, "alpha")[: {0: 0, 1: 4}.get(len(colour_channels), 3)]
    unchanged = element.others(further, *colours)
    known = known_columns(bake)
    added = [Property(name, "f", known["w"]) for name in filter(None, (W, further))]
    if bake.below:
        added.append(Property(f"{W}_below", "f", bake.below.w.astype("<f4")))
    if bake.profile:
        columns = enumerate(bake.profile.values.T)
        added += [Property(f"{layout.PROFILE}{number:02}", "f", column.astype("<f4")) for number, column in columns]
    if len(colour_channels) == 1:
        added += layout.with_channel(bake.w, colour_channels, stored_colors((element,)))
    elif colour_channels:
        grey = grey_of(bake.w)
        added += [Property(name, "B", grey) for name in RGB]
    for name in [name for name in BAKED if name in known and name != "w"]:
        axes = zip(layout.AXES if known[name].ndim > 1 else ("",), np.atleast_2d(known[name].T), strict=True)
        added += [Property(BAKED[name] + axis, column.dtype.char, column) for axis, column in axes]
    return replace(element, properties=(*unchanged, *added))


def _elements(asset: Asset) -> tuple[Element, ...]:
    """Elements of what was no PLY: vertices, and faces with what else the source holds of them."""
    # Coordinates and normals.
    mesh = asset.mesh
    columns = [Property(axis, "f", mesh.vertices[:, number]).fitting() for number, axis in enumerate("xyz")]
    if any(column.kind == "d" for column in columns):
        columns = [column._replace(kind="d") for column in columns]
    if mesh.normals is not None:
        normals = float_normals(mesh.normals)
        columns += [Property(axis, "f", column) for axis, column in zip(("nx", "ny", "nz"), normals.T, strict=True)]
    # Polygons, texture coordinates and colours.
    lists = []
    uv = asset.of_polygons("uv0", missing=(0, 1))
    if uv and np.isfinite(uv.values).all():
        by_vertex = uv.at_vertices(asset.corners, len(mesh.vertices))
        if by_vertex is None:
            values = uv.values[uv.of]
            lists = [Property("texcoord", "f", values.astype("<f4").ravel(), "B", 2 * asset.sizes)]
        else:
            columns += [Property(name, "f", by_vertex[:, n].astype("<f4")) for n, name in enumerate("st")]
    colours = asset.colours(srgb=True)
    if colours is not None:
        if colours.shape[1] == 4 and (colours[:, 3] == 1).all():
            colours = colours[:, :3]
        levels = np.rint(np.clip(np.nan_to_num(colours), 0, 1) * 255)
        columns += [Property(name, "B", column) for name, column in zip((*RGB, "alpha"), levels.T, strict=False)]
    faces = Property("vertex_indices", "i", asset.corners, "B", asset.sizes)
    return Element("vertex", len(mesh.vertices), tuple(columns)), Element("face", len(asset.sizes), (faces, *lists))


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
