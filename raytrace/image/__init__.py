"""Pixels in and out: image files, colour encoding, textures, comparison."""
