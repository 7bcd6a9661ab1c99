"""Parts of a batch: whole meshes, dealt by the sizes of their files; and the manifest of all parts together."""

from __future__ import annotations

import heapq
import json
import re
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from raytrace.errors import InputError

from .inputs import MANIFEST
from .manifest import VERSION, Entry, Manifest

_NAME = re.compile(r"manifest-\d+-of-(\d+)\.json")


def part_manifest(number: int, of: int) -> str:
    """The name of the manifest of a part."""
    return f"manifest-{number:0{len(str(of))}}-of-{of}.json"


def dealt(sizes: Sequence[int], of: int) -> list[int]:
    """Which of the parts 1 to `of` bakes each mesh: the largest first, each to who has the least to do yet."""
    owners, loads = [0] * len(sizes), [(0, part) for part in range(1, of + 1)]
    for place in sorted(range(len(sizes)), key=lambda place: -sizes[place]):
        load, owners[place] = heapq.heappop(loads)
        heapq.heappush(loads, (load + sizes[place] + 1, owners[place]))
    return owners


def is_batch_of_parts(folder: Path) -> bool:
    """Whether a folder has manifests of parts."""
    return folder.is_dir() and any(_NAME.fullmatch(path.name) for path in folder.iterdir())


def merge_batch(folder: Path) -> Manifest:
    """Make one manifest of those of all parts.

    Raises:
        InputError: a part is missing, not finished, or of another batch.
        OutputError: the manifest cannot be written.
    """
    paths = sorted(path for path in folder.iterdir() if _NAME.fullmatch(path.name))
    parts = [_read(path) for path in paths]
    first = parts[0]
    for path, part in zip(paths, parts, strict=True):
        for name in first["options"].keys() | part["options"].keys():
            _same(path, name, first["options"].get(name), part["options"].get(name))
        _same(path, "versions", first["versions"], part["versions"])
        _same(path, "of", first["part"]["of"], part["part"]["of"])
        _same(path, "inputs", first["part"]["inputs"], part["part"]["inputs"])
    of, numbers = first["part"]["of"], {part["part"]["number"] for part in parts}
    if missing := sorted({*range(1, of + 1)} - numbers):
        lacking = ", ".join(map(str, missing[:20])) + (", …" if len(missing) > 20 else "")
        raise InputError(folder, "parts", f"all of 1 to {of}", f"{len(parts)} of them; missing: {lacking}")
    entries = {each["input"]: Entry(**each) for part in parts for each in part["inputs"]}
    for path, part in zip(paths, parts, strict=True):
        if part["waiting"]:
            expected = "a finished part; the same command continues it"
            raise InputError(path, "waiting", expected, f"{part['waiting']:,} meshes that wait")
    for name in first["part"]["inputs"]:
        if name not in entries:  # the parts saw files of other sizes
            raise InputError(folder, "inputs", f"{name} in one of the parts", "none that has it")
    about = {name: first[name] for name in ("options", "versions")}
    manifest = Manifest(folder / MANIFEST, [entries[name] for name in first["part"]["inputs"]], about)
    manifest.write()
    return manifest


def _same(path: Path, name: str, expected: object, got: object) -> None:
    """Raises: InputError: they differ."""
    if expected != got:
        raise InputError(path, name, f"{expected}, as in the first part", got)


def _read(path: Path) -> dict[str, Any]:
    try:
        stored: dict[str, Any] = json.loads(path.read_bytes())
        part, names = stored["part"], {field.name for field in fields(Entry)}
        whole = isinstance(part["number"], int) and isinstance(part["of"], int) and isinstance(part["inputs"], list)
        whole = whole and isinstance(stored["options"], dict) and isinstance(stored["waiting"], int)
        whole = whole and all({*each} == names for each in stored["inputs"]) and "versions" in stored
        version = stored["manifest_version"] if whole else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        version = None
    if version != VERSION:
        raise InputError(path, "manifest_version", f"the manifest of a part, of version {VERSION}", "something else")
    return stored
