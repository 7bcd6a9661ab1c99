"""Accessors of a glTF that are wrong: one line, before rays are traced, wherever a command reads attributes again."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from fuzz_seeds import EXTRAS, NODES, builder
from gltf_files import change

from obscurance.raytrace.errors import ObscuranceError
from obscurance.scenes.commands.prune import prune
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.formats.gltf.vertices import check_vertices
from obscurance.scenes.formats.load import load

FIELDS = {
    "count": [0, 1, 2, 3, 5, 1000, 10**9, -1, 1.5],
    "type": ["SCALAR", "VEC2", "VEC4", "MAT4", "x"],
    "componentType": [5120, 5121, 5122, 5123, 5125, 5126, 9],
    "bufferView": [0, 1, 99, -1, None],
    "byteOffset": [1, 4, 10**9, -4],
    "normalized": [True, "x"],
    "sparse": [{"count": 1, "indices": {"bufferView": 99, "componentType": 5123}, "values": {"bufferView": 0}}],
    "min": [[], "x", None],
}
PRIMITIVES = [(mesh, number) for mesh, primitives in enumerate((2, 2, 1)) for number in range(primitives)]


def mistakes():
    """Places in a header, and values: each field of each accessor, and each attribute of each primitive as another."""
    accessors = range(len(builder().header["accessors"]))
    for number in accessors:
        for field, values in FIELDS.items():
            yield from ((f"accessors/{number}/{field}", value) for value in values)
    for mesh, number in PRIMITIVES:
        for name in ("TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "TANGENT", "_ANY", "WEIGHTS_0"):
            place = f"meshes/{mesh}/primitives/{number}/attributes/{name}"
            yield from ((place, accessor) for accessor in (*accessors, 99, -1))


@pytest.mark.parametrize("share", range(3))
def test_a_wrong_accessor_ends_in_one_line(tmp_path, monkeypatch, share):
    monkeypatch.setattr("obscurance.ao.unseen.unseen_faces", hidden)
    failed = []
    refused = 0
    for place, value in islice(mistakes(), share, None, 12):
        made = builder()
        change(made.header, {place: value})
        path = tmp_path / "m.glb"
        path.write_bytes(made.glb(NODES, **EXTRAS))
        for output in ("out.glb", "page.glb", "out.ply"):
            try:
                if output == "page.glb":
                    unwrapped(path)
                else:
                    prune(path, tmp_path / output, True, "faces", 0)
            except ObscuranceError:  # whose message is one line
                refused += 1
            except Exception as error:
                failed.append(f"{place} = {value}, {output}: {error!r}")
    assert not failed, "\n".join(failed)
    assert refused > 20


def hidden(mesh, **_):
    """In place of what is found by rays: the last face is not seen."""

    class Unseen:
        faces = np.arange(len(mesh.faces)) == len(mesh.faces) - 1

        def share(self, faces):
            return 0.0

    return Unseen()


class Page:
    """In place of a baked texture: new coordinates for all corners."""

    def __init__(self, count):
        self.uv = (
            np.tile([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]], (count, 1, 1)) * np.linspace(0.5, 1, count)[:, None, None]
        )
        self.w = np.full((4, 4), 0.5)


def unwrapped(path: Path) -> None:
    mesh_file = load(path, "page.glb")
    check_vertices(mesh_file)
    textured_glb(mesh_file, [Page(len(mesh_file.mesh.faces))])
