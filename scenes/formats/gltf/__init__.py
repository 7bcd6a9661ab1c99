"""glTF 2.0: JSON with files beside it, .gltf, and binary, .glb, in which bakes are written; .vrm is a GLB."""

FORMATS = (
    {
        "ending": ".glb",
        "name": "GLB",
        "read": "obscurance.scenes.formats.gltf.read:read_gltf",
        "peak": 2.0,
        "begins": rb"glTF",
        "write": "obscurance.scenes.formats.gltf.write:glb",
        "holds": ("source", "w", "profile", "colors", "scene"),
        "unit": 1.0,
    },
    {
        "ending": ".gltf",
        "name": "glTF",
        "read": "obscurance.scenes.formats.gltf.read:read_gltf",
        "peak": 2.0,
        "begins": rb"\s*\{",
        "holds": ("w", "profile", "scene"),
        "unit": 1.0,
    },
    {
        "ending": ".vrm",
        "name": "VRM",
        "read": "obscurance.scenes.formats.gltf.read:read_gltf",
        "peak": 2.0,
        "holds": ("scene",),
        "unit": 1.0,
    },
)
