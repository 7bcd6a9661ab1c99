"""The stress suite: poses, contacts, defects, limits of float32."""
