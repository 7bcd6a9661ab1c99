"""`obscurance falloff`: w at other half-distances, from the profile that a bake has stored, without rays."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, cast

from obscurance.raytrace.errors import ConflictError, OptionError, SceneError, printable
from obscurance.raytrace.system.atomic import write_bytes
from obscurance.raytrace.system.checks import check_ending, check_outputs

from ..asset.asset import Asset
from ..asset.primitive import StoredBake
from ..bake.console import warn
from ..bake.record import Record
from ..formats.images import check_texture_target, write_grey
from ..formats.load import load_faces_or_points, read_asset
from ..formats.stored_w import Scales, checked_profile, find_profile, read_beside_w
from ..formats.table import endings
from ..formats.unsupported import unsupported_features
from ..formats.write import channels, check_target, npy, npz, write_vertices

if TYPE_CHECKING:
    from obscurance.ao import Bake


def change_falloff(baked: Path, scales: Scales, output: Path, mesh: Path | None) -> str:
    """Write w at other half-distances in the format of the output's ending, and return a line about it.

    Args: baked: a `.npz`, an `.exr` or a mesh file with a profile. mesh: what a `.npz` belongs to, for other formats.
    """
    check_ending("baked", baked, ".exr", *(ending for ending in endings("profile") if ending != ".html"))
    if mesh and baked.suffix.lower() != ".npz":
        raise ConflictError("mesh", "needs", "a .npz")
    textured = baked.suffix.lower() == ".exr"
    if textured:
        check_texture_target("output", output)
    else:
        check_target(output)
    check_outputs({"--output": output}, [baked, *([mesh] if mesh else [])])
    if textured:
        profile = checked_profile(baked, find_profile(baked))
        w = scales.of(profile)
        described = {"content": "w, 1 = open", "bake": _record(baked, None, scales)}
        write_grey(output, w.astype("<f4"), False, described, profile=profile)
        count = f"{w.size:,} texels"
    else:
        count = f"{_write_vertices(baked, scales, output, mesh):,} vertices"
    terms = zip(scales.half_distances, scales.powers, strict=True)
    factors = (f"w at {length}" + (f" to the power of {power:g}" if power != 1 else "") for length, power in terms)
    return printable(f"{output}: {' × '.join(factors)}, {count}, no rays traced")


def _write_vertices(baked: Path, scales: Scales, output: Path, mesh: Path | None) -> int:
    """Write a bake to vertices, and return their number."""
    source = None if baked.suffix.lower() == ".npz" else load_faces_or_points(baked, output)
    profile = checked_profile(baked, source.profile if source and not source.cloud else find_profile(baked))
    file = load_faces_or_points(mesh, output) if mesh else source
    arrays: dict[str, Callable[..., memoryview]] = {".npy": npy, ".npz": npz}
    is_array = output.suffix.lower() in arrays
    if file is None and not is_array:
        raise OptionError("mesh", f"--mesh with the mesh that {baked.name} belongs to", "none")
    w = scales.of(profile)
    if file and file.cloud and output.suffix.lower() not in (*arrays, ".ply"):
        raise OptionError("output", "a name ending in .npy, .npz or .ply, of points", output)
    count = len(file.cloud[0] if file.cloud else file.mesh.vertices) if file else len(w)
    if len(w) != count:
        raise SceneError(baked, "profile", f"a row for each of the {count:,} vertices", f"{len(w):,}")
    shown = channels(output, None, None, False)._replace(record=_record(baked, source, scales))
    if file:
        warn([], unsupported_features(output, file, shown))
    flags = source.baked.flags if source and source.baked else read_beside_w(baked, len(w)).get("flags")
    values = cast("Bake", StoredBake(w, flags=flags, profile=profile))
    if is_array:
        write_bytes(output, arrays[output.suffix.lower()](values, None, shown))
    elif file:
        write_vertices(output, values, file, shown._replace(again=_command_again(baked, file, mesh)))
    return len(w)


def _record(baked: Path, source: Asset | None, scales: Scales) -> str:
    """The record of a bake with another half-distance, as of `Channels`; empty of a product of several."""
    record = Record.read(baked, source if source is None or source.raw else read_asset(baked))
    if record is None or len(scales.half_distances) > 1 or scales.powers != (1.0,):
        return ""
    options = {name: value for name, value in record.options.items() if name != "tau"}
    return record._replace(options=options | {"half_distance": scales.half_distances[0]}).text


def _command_again(baked: Path, file: Asset, mesh: Path | None) -> str:
    """The command that writes w at another half-distance, "{}", into a file."""
    target = f"{baked.stem}-falloff{'.glb' if file.is_scene else '.ply'}"
    besides = ["--mesh", str(mesh)] if mesh else []
    return (
        shlex.join(["obscurance", "falloff", str(baked), *besides]) + f" --half-distance {{}} -o {shlex.quote(target)}"
    )
