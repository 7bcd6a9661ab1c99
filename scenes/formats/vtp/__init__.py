"""VTK's XML files of polygons, which PyVista and ParaView read."""

from ..table import FileFormat, register

register(
    FileFormat(
        ".vtp",
        "VTK",
        write="obscurance.scenes.formats.vtp.write:vtp",
        holds=("source",),
    )
)
