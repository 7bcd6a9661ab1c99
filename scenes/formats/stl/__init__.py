"""STL, text and binary."""

from ..table import FileFormat, register

register(
    FileFormat(
        ".stl", "STL", read="obscurance.scenes.formats.stl.read:read_stl", peak=6.0, begins=rb"\s*solid\b.*\n\s*facet\b"
    )
)
