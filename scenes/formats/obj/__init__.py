"""Wavefront OBJ with its material libraries; out with w as vertex colours."""

FORMATS = (
    {
        "ending": ".obj",
        "name": "OBJ",
        "read": "obscurance.scenes.formats.obj.read:read_obj",
        "peak": 9.0,
        "begins": rb"(\s*(#[^\n]*)?\n)*\s*(v|vn|vt|o|g|mtllib|usemtl|s)\s",
        "write": "obscurance.scenes.formats.obj.write:obj",
        "holds": ("source", "uv"),
    },
)
