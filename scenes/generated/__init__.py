"""Mesh families drawn by seed, to judge tolerances on meshes never seen."""
