"""Textures in .glb files before glTF's own validator (`make viewers`).

Of hand-made samples, of built-in shapes, and of the mesh files in a folder that the variable MESHES names.
"""

import os
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import validator
from gltf_samples import SAMPLES
from uv_meshes import grid_charts

from obscurance.raytrace import MeshError
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.formats.load import load
from obscurance.scenes.geometry.builtin_shapes import SOLIDS

pytestmark = pytest.mark.skipif(validator.missing() is not None, reason=str(validator.missing()))
W = np.random.default_rng(0).random((16, 16)).astype(np.float32)
WAYS = (False, False), (True, False), (False, True)
FOLDER = os.environ.get("MESHES")
FILES = [path for path in sorted(Path(FOLDER).iterdir()) if path.suffix in (".glb", ".obj")] if FOLDER else []


def outputs(folder, source, name, ways=WAYS):
    """The source with its own coordinates, if it has some everywhere, and with new ones, by some options."""
    numbers = [grid_charts(len(source.mesh.faces))]
    with suppress(MeshError):
        numbers += [0] * (source.uv is not None)
    for uv in numbers:
        for replace, orm in ways:
            target = folder / f"{name}-{'own' if isinstance(uv, int) else 'new'}-{replace}-{orm}.glb"
            all_uv, odd = source.uv if isinstance(uv, int) else uv, np.zeros((len(source.mesh.faces), 1, 1), bool)
            for part in source.parts[1::2]:
                odd[part.faces] = True
            sets = [SimpleNamespace(w=W, uv=np.where(odd == which, all_uv, np.nan)) for which in (False, True)]
            rest = np.linspace(0, 1, len(source.mesh.vertices))
            target.write_bytes(textured_glb(source, sets, replace, orm, rest)[0])
            yield target


def faults(targets):
    return {path.name: found for path, found in zip(targets, validator.errors(*targets), strict=True) if found}


def test_the_validator_finds_no_error_in_textured_samples_and_shapes(tmp_path):
    shapes = {name: Asset.of(kind().geometry().mesh) for name, kind in SOLIDS.items()}
    targets = [path for name, shape in shapes.items() for path in outputs(tmp_path, shape, name, WAYS[2:])]
    for name, make in SAMPLES.items():
        (tmp_path / f"{name}.glb").write_bytes(make())
        targets += outputs(tmp_path, load(tmp_path / f"{name}.glb", "out.glb"), name)
    assert {"rough-own-False-True.glb", "occluded-own-True-False.glb"} <= {path.name for path in targets}
    assert faults(targets) == {}


@pytest.mark.skipif(not FILES, reason="the variable MESHES names no folder of meshes")
def test_the_validator_finds_no_error_in_textured_files(tmp_path):
    for file in FILES:
        targets = list(outputs(tmp_path, load(file, "out.glb"), file.stem))
        before = len(validator.errors(file)[0]) if file.suffix == ".glb" else 0
        assert before or faults(targets) == {}, file.name
