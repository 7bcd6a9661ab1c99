"""OFF, text."""

from ..table import FileFormat, register

register(
    FileFormat(
        ".off", "OFF", read="obscurance.scenes.formats.off.read:read_off", peak=7.5, begins=rb"\s*(ST)?(C?N?4?n?)OFF\b"
    )
)
