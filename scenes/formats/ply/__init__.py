"""PLY, text and binary."""

from ..table import FileFormat, register

register(
    FileFormat(
        ".ply",
        "PLY",
        read="obscurance.scenes.formats.ply.read:read_ply",
        peak=7.5,
        begins=rb"ply\r?\n",
        write="obscurance.scenes.formats.ply.write:ply",
        holds=("source", "w", "faces", "colors", "uv"),
    )
)
