"""glTF 2.0 with occlusion, as written."""
