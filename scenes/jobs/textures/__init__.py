"""Occlusion textures as files."""
