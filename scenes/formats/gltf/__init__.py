"""glTF 2.0: JSON with files beside it, .gltf, and binary, .glb, in which bakes are written."""
