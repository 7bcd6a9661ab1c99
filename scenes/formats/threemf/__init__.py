"""3MF."""

from ..table import FileFormat, register

register(
    FileFormat(".3mf", "3MF", read="obscurance.scenes.formats.threemf.read:read_3mf", peak=1.0, begins=rb"PK\x03\x04")
)
