"""PLY, text and binary."""

FORMATS = (
    {
        "ending": ".ply",
        "name": "PLY",
        "read": "obscurance.scenes.formats.ply.read:read_ply",
        "peak": 7.5,
        "begins": rb"ply[\r\n]",
        "write": "obscurance.scenes.formats.ply.write:ply",
        "holds": ("source", "w", "profile", "faces", "colors", "uv"),
    },
)
