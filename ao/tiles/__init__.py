"""Bakes of meshes larger than memory: tile by tile, each with what is within reach of it."""
