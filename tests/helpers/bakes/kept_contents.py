"""Bakes whose output keeps what it can of the input, and what they report."""

import json

from command import succeeded

from obscurance.scenes.formats.load import load


def bake(folder, source, target, *options):
    """What the command reports on standard error."""
    done = succeeded(
        "bake", folder / source, "-o", folder / target, "--samples", 8, "--report", folder / "r.json", *options
    )
    printed = done.stderr.replace(str(folder) + "/", "")
    for line in report(folder):
        kind = "note" if ": not kept from " in line else "warning"
        assert f"{kind}: {line.replace(str(folder) + '/', '')}\n" in printed
    return printed


def report(folder):
    return json.loads((folder / "r.json").read_text())["warnings"]


def columns(path):
    """The properties of a PLY file's elements by element and name, as our reader has them."""
    asset = load(path, "x.ply")
    return {element.name: {c.name: c for c in element.properties} for element in asset.raw.elements}, asset
