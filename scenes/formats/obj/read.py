"""Wavefront OBJ: geometry over exactly the file's own `v` lines; colours, texture coordinates, materials, alpha.

trimesh's reader splits, repeats or drops vertices, takes index 0 for 1 and wraps negative ones. Memory is estimated at
9 times the bytes of a file, where what trimesh reads takes 22 times (evidence/reliability.md).
"""

from collections.abc import Callable

from ...asset.asset import Asset, Node
from ...asset.material import Material
from ...asset.primitive import COLOR, NORMAL, Column, ColumnSet, Primitive
from ..table import MeshInput
from .mtl import LIBRARY, OPAQUE, OPTION, read_libraries
from .text import Obj, ObjText

MAX_OBJECTS = 4096  # each takes a kilobyte or two of a .glb
_OTHER = "l", "p", "curv", "curv2", "surf"
_EXPLAINED = {  # of what is left out of materials, what matters to alpha
    OPAQUE: "",
    LIBRARY: " is not there: what it paints is opaque",
    OPTION: " is not read",
    "texture of map_d": " is not read: alpha there is that of d alone",
}


def read_obj(mesh_input: MeshInput) -> Asset:
    """All faces of the file, in its order, as one primitive: no vertices are divided in OBJ.

    Raises: as `ObjText`.
    """
    file = ObjText(mesh_input.file.read(), mesh_input.source)
    notes = dict.fromkeys(file.notes)
    # Faces by the statements before them: objects, or groups where those alone divide the file, and materials.
    by_object = file.named("o")
    by_group = file.named("g")
    objects = by_group if by_object.kinds < 2 <= by_group.kinds or not by_object.names else by_object
    keeps_objects = bool(objects.names) and objects.kinds <= MAX_OBJECTS
    used = file.named("usemtl")
    of_name, files, missing = read_libraries(file.lines("mtllib"), mesh_input.path.parent)
    columns = _columns(file, notes)
    primitive = Primitive.of(
        file.vertices,
        file.corners,
        file.sizes,
        mesh_input.source,
        columns=columns,
        material=used.of if used.names else None,
        object=objects.of if keeps_objects else None,
    )
    if mesh_input.alpha:
        explained = [words + end for words in missing for begin, end in _EXPLAINED.items() if words.startswith(begin)]
        notes |= dict.fromkeys(explained)
        missing = [words for words in missing if not any(note.startswith(words) for note in explained)]
    if not used.names:
        files, missing = [], []
    # What is left out, in words.
    left_out = (
        (by_object.kinds > 1 and by_group.kinds > 1, "names of groups"),
        (objects.kinds > MAX_OBJECTS, f"its division into {objects.kinds:,} objects"),
        (len(set(file.lines("s").split())) > 1, "smoothing groups"),
        (any(run.keyword in _OTHER for run in file.runs), "lines, points, curves and surfaces"),
        (file.has_colors and COLOR not in columns, "colours, which some vertices lack or have outside of [0, 1]"),
    )
    return Asset(
        mesh_input.path,
        (primitive,),
        (Node(mesh_input.name, (0,)),),
        materials=tuple(of_name.get(name, Material(name)) for name in used.names),
        names=objects.names if keeps_objects else (),
        warnings=notes,
        unread=tuple(dict.fromkeys([*(words for is_left_out, words in left_out if is_left_out), *missing])),
        pictures=tuple(files),
        raw=Obj(file.runs),
        has_alpha=mesh_input.alpha,
    )


def _columns(file: ObjText, notes: dict[str, None]) -> ColumnSet:
    """Normals, colours, and texture coordinates, which are read when they are used. Args: notes: gets what is wrong."""
    columns: dict[str, Column | Callable[[], Column]] = {}
    if normals := file.normals():
        columns[NORMAL] = Column(*normals).of_vertices(file.corners, len(file.vertices))
    if file.colors is not None and ((file.colors >= 0) & (file.colors <= 1)).all():
        columns[COLOR] = Column(file.colors, srgb=True)

    def uv() -> Column:
        uv = file.uv
        assert uv
        notes.update(dict.fromkeys(file.notes))
        return Column(*uv)

    if file.some("vt").any():
        columns["uv0"] = uv
    return ColumnSet(columns)
