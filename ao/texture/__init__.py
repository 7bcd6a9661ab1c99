"""Occlusion textures: texels of a page, points of the surface in each, padding, seams."""
