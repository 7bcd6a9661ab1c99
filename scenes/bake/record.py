"""The record of a bake in the files that hold its w: the options that decide w, and a hash of the mesh."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from obscurance.raytrace.errors import InputError, SceneError
from obscurance.raytrace.mesh.mesh import shape_hash

from ..formats.images import is_texture
from ..formats.load import parser_errors
from ..formats.table import is_raster
from ..json_toml import parse_json
from .options import ROWS, check_stored, plain

if TYPE_CHECKING:
    from obscurance.raytrace.mesh.mesh import Mesh

    from ..asset.asset import Asset
    from .plan import Plan


class Record(NamedTuple):
    """Attributes: options: by their names in a report, those that are not the default. mesh: its `shape_hash`."""

    options: dict[str, Any]
    mesh: str

    @classmethod
    def of(cls, plan: Plan, mesh: Mesh) -> Self:
        """The record of a bake of the input's mesh."""
        options = plan.changed()
        options.pop("between", None)  # the mesh is the one that is cut
        if plan.options.up:  # which the ground and normals go by
            options["up"] = plan.options.up
        return cls(options, shape_hash(mesh))

    @classmethod
    def read(cls, path: Path, asset: Asset | None) -> Self | None:
        """The record in a baked file, None where there is none. Raises: InputError: it has options of other types.

        Args: asset: the file's content, if it is a mesh.
        """
        text = asset.raw.record if asset and asset.raw else _text(path)
        stored: Any = None
        with suppress(ValueError, RecursionError):
            stored = parse_json(text.encode())
        if not (isinstance(stored, dict) and isinstance(stored.get("options"), dict)):
            return None
        options = {name: value for name, value in stored["options"].items() if name in ROWS}
        check_stored(path, options)
        return cls({name: _parsed(name, value) for name, value in options.items()}, str(stored.get("mesh", "")))

    @property
    def text(self) -> str:
        """The record as files hold it, JSON in one line of ASCII."""
        options = {name: plain(value) for name, value in self.options.items()}
        return json.dumps({"options": options, "mesh": self.mesh}, separators=(",", ":"))


def _parsed(name: str, value: Any) -> Any:
    """The value of an option in a record."""
    row = ROWS[name]
    return [row.parsed(item) for item in value] if isinstance(value, list) else row.parsed(value)


def _text(path: Path) -> str:
    """The record's text in a file that is no mesh, empty if there is none. Raises: InputError: it cannot be read."""
    if path.suffix.lower() == ".npz":
        with parser_errors(path, SceneError), np.load(path, allow_pickle=False) as arrays:
            return str(arrays["bake"]) if "bake" in arrays else ""
    if is_raster(path):
        from ..formats.raster import stored_record

        with suppress(InputError):  # an image of a texture
            return stored_record(path)
    if is_texture(path):
        from obscurance.raytrace.image.read import read_metadata

        return read_metadata(path).get("bake", "")
    return ""
