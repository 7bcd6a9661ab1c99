"""PLY, text and binary."""

from ..table import FileFormat, register

register(
    FileFormat(
        ".ply",
        "PLY",
        read="scenes.formats.ply.read:read_ply",
        peak=7.5,
        begins=rb"ply\r?\n",
        write="scenes.formats.ply.write:ply",
        unsupported="scenes.formats.ply.write:unsupported_features",
        holds=("w", "faces", "colors", "uv"),
    )
)
