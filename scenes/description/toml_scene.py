"""TOML scenes: from the text to a scene description."""

import re
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from obscurance.ao.options import Options
from obscurance.raytrace import Camera, Scene, Settings, light_from_dict
from obscurance.raytrace.camera import FROM
from obscurance.raytrace.errors import OptionError, SceneError
from obscurance.raytrace.mesh.mesh import UP
from obscurance.raytrace.system.checks import check_regular
from obscurance.raytrace.system.records import fields_of

from ..falloffs import make_falloff, make_scales, table_of
from ..formats.stored_w import ENDINGS, Scales
from ..json_toml import check_keys, located, shown
from ..safe_paths import confined
from .description import SceneDescription, Source, three_lights
from .schema import CameraTable, Document, ObscuranceTable, parse_document
from .toml_objects import ObjectReader, named_materials

_LARGEST = 16 << 20  # bytes; tomllib takes a second for each
_PARTS = 100  # tomllib takes memory by the square of their number
_LONG_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){""" + f"{_PARTS - 1}}}"
)


def read_toml(path: Path, size: tuple[int, int] | None) -> SceneDescription:
    """A TOML scene; files it names are looked for in its own folder and below. Raises: SceneError."""
    document = parse_document(_load(path), path)
    settings = _settings(document, path, size)
    w_from, bake, scales, files = _obscurance(document.obscurance, path, settings)
    reader = ObjectReader(path, named_materials(document.materials, path))
    objects = [item for n, table in enumerate(document.objects) for item in reader.read(table, f"objects[{n}]")]
    lights = []
    for number, table in enumerate(document.lights):
        field = f"lights[{number}]"
        if isinstance(table.get("image"), str):
            image = confined(table["image"], path.parent, path, f"{field}.image")
            reader.files.append(image)
            table = table | {"image": image}
        with located(path, field):
            lights.append(light_from_dict(table))
    scene = Scene(tuple(objects), tuple(lights), document.background)
    camera = _camera(document.camera, scene, settings, path)
    if not lights:
        scene = replace(scene, lights=three_lights(camera))
    origins = tuple(reader.origins.get(id(item.shape)) for item in objects)
    read = (path, *reader.files, *files)
    return SceneDescription(
        scene, camera, settings, w_from, bake, read, tuple(reader.notes), origins, scales, lit_from_camera=not lights
    )


def _load(path: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises: SceneError: it cannot be read, is very large or deep, or is no TOML."""
    try:
        check_regular(path, "a scene file", SceneError)
        if (size := path.stat().st_size) > _LARGEST:
            raise SceneError(path, "content", f"at most {_LARGEST:,} bytes of TOML", f"{size:,}")
        content = path.read_bytes()
    except OSError as reason:
        raise SceneError(path, "file", "a readable file", reason.strerror or reason) from None
    if not content.strip():
        raise SceneError(path, "content", "a TOML scene", "an empty file")
    # Text without what takes the parser very long.
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        line = content.count(b"\n", 0, reason.start) + 1
        raise SceneError(path, f"line {line}", "UTF-8", f"byte {content[reason.start]:#04x}") from None
    if _LONG_KEY.search(text):
        raise SceneError(path, "content", f"keys of fewer than {_PARTS} parts", "a longer one")
    # Its tables.
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as reason:
        message, _, where = str(reason).removesuffix(")").rpartition(" (at ")
        got = "a mistake: " + " ".join(re.sub(r"^[A-Z]", lambda m: m[0].lower(), message).split())
        raise SceneError(path, where, "valid TOML", got) from None
    except ValueError as reason:
        raise SceneError(path, "content", "valid TOML", f"a mistake: {shown(reason)}") from None
    except RecursionError:
        raise SceneError(path, "content", "tables of a few levels", "very many") from None


def _settings(document: Document, path: Path, size: tuple[int, int] | None) -> Settings:
    """The settings of `[render]`, with the form of `[obscurance]`.

    Args: size: width and height in place of the file's.
    """
    values = document.render if size is None else document.render | {"width": size[0], "height": size[1]}
    check_keys(path, "render", values, [name for name in fields_of(Settings) if name != "obscurance"])
    with located(path, "render"):
        settings = Settings(**values)
    form = document.obscurance.form
    if form is None:
        return settings
    try:
        return replace(settings, obscurance=form)  # type: ignore[arg-type]
    except OptionError as fault:
        raise SceneError(path, "obscurance.form", fault.expected, shown(form), fault.nearest) from None


def _obscurance(
    table: ObscuranceTable, path: Path, settings: Settings
) -> tuple[Source, Options, Scales | None, list[Path]]:
    """The source of w, the options of its bake, scales, and the files of these, as `SceneDescription` has them."""

    def excluded(expected: str, *names: str) -> None:
        """Refuse the keys `names`, which do not go with other values.

        Args: expected: what would.

        Raises: SceneError.
        """
        for name in names:
            if name in vars(table):
                raise SceneError(path, f"obscurance.{name}", expected, shown(getattr(table, name)))

    bake = ("falloff", "tau", "half_distance", "max_distance", "samples", "seed")
    if settings.obscurance == "off":
        excluded('nothing beside form = "off"', "baked", "power", *bake)
        return "off", Options(), None, []
    if table.baked is not None:
        excluded("nothing beside baked but form, half_distance and power", *(set(bake) - {"half_distance"}))
        file = confined(table.baked, path.parent, path, "obscurance.baked")
        if file.suffix.lower() not in ENDINGS:
            raise SceneError(path, "obscurance.baked", "a name ending in " + ", ".join(ENDINGS), shown(table.baked))
        if table.half_distance is None:
            excluded("half_distance with it", "power")
            return file, Options(), None, [file]
        with located(path, "obscurance"):
            return file, Options(), make_scales(table.half_distance, table.power), [file]
    excluded("baked with it", "power")
    locate = partial(confined, folder=path.parent, source=path, field="obscurance.falloff")
    with located(path, "obscurance"):
        falloff = make_falloff(table.falloff, table.tau, table.half_distance, table.max_distance, locate)
        options = Options(falloff=falloff, samples=table.samples, seed=table.seed or 0, denoise=False)
    return "bake", options, None, table_of(table.falloff, locate)


def _camera(table: CameraTable, scene: Scene, settings: Settings, path: Path) -> Camera:
    """The camera of `[camera]`: as placed there, or one that frames everything. Raises: SceneError."""
    values = dict(vars(table))
    if "height" in values and "field_of_view" in values:
        raise SceneError(path, "camera.height", "either height or field_of_view", "both")
    if ("position" in values) != ("target" in values):
        missing = "target" if "position" in values else "position"
        raise SceneError(path, f"camera.{missing}", "position and target together", "nothing")
    with located(path, "camera"):
        if "position" in values:
            if "direction" in values:
                raise SceneError(path, "camera.direction", "either direction, or position and target", "both")
            return Camera(**values)
        direction = values.pop("direction", FROM[UP["z"]])
        if not any(direction):
            raise SceneError(path, "camera.direction", "a vector other than zero", list(direction))
        aspect = settings.width / settings.height
        view = {"up": UP["z"]} | {name: values.pop(name) for name in ("up", "field_of_view") if name in values}
        with np.errstate(over="ignore", invalid="ignore"):
            return replace(Camera.framing(scene.flattened(), direction, aspect=aspect, **view), **values)
