"""The stability suite: poses, contacts, defects, limits of float32."""
