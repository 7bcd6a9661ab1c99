"""COLLADA, by the optional library pycollada."""

from ..table import FileFormat, register

_READ, _UNIT = "obscurance.scenes.formats.dae.read:read_dae", "obscurance.scenes.formats.dae.read:unit"
_BEGINS = rb"(?s)(\xef\xbb\xbf)?\s*(<\?xml.*?\?>\s*)?(<!--.*?-->\s*)*<COLLADA\b"

register(
    FileFormat(".dae", "COLLADA", read=_READ, peak=22.0, begins=_BEGINS, unit=_UNIT),
    FileFormat(".zae", "COLLADA", read=_READ, peak=22.0),
)
