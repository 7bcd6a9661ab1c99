"""The help of `obscurance bake` in sections: its options are too many for one list."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand

SECTIONS = {
    "What occludes": ("falloff", "tau", "half_distance", "max_distance", "normals", "hidden", "alpha"),
    "Sampling": ("method", "reconstruct", "traversal", "seed", "threads"),
    "What .glb and .ply show": ("colors", "occlusion", "replace_occlusion", "orm"),
    "Textures": (
        *("size", "texel_size", "uv", "mesh_output", "overlap", "bent_normals", "bent_space", "error_map"),
        *("high", "cage", "half"),
    ),
    "More than one machine, or than its memory": ("part", "cluster", "shared", "tiles"),
    "Reports, repeats, other programs": (
        *("report", "debug_image", "up", "from_report", "resume", "dry_run", "progress", "format", "input_format"),
    ),
}
EXAMPLES = """\b
Examples:
  obscurance bake bunny.obj -o bunny.ply
  obscurance bake bunny.obj -o bunny.glb --falloff binary --tolerance 0.01
  obscurance bake 'meshes/*.obj' --output-dir baked --format glb
  obscurance bake chair.glb -o chair-occlusion.png --size 2048
"""


class SectionedCommand(TyperCommand):
    """A command whose help lists options by what they are for, those of no section first."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        section = {name: title for title, names in SECTIONS.items() for name in names}
        rows: dict[str, list[tuple[str, str]]] = {title: [] for title in ("Arguments", "Options", *SECTIONS)}
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx)
            if row is not None:
                general = "Arguments" if parameter.param_type_name == "argument" else "Options"
                rows[section.get(str(parameter.name), general)].append(row)
        for title, found in rows.items():
            with formatter.section(title):
                formatter.write_dl(found)
