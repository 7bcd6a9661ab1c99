"""3MF."""

from ..table import FileFormat, register

_READ, _UNIT = "obscurance.scenes.formats.threemf.read:read_3mf", "obscurance.scenes.formats.threemf.read:unit"

register(FileFormat(".3mf", "3MF", read=_READ, peak=1.0, begins=rb"PK\x03\x04", unit=_UNIT))
