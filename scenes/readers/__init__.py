"""Mesh files in."""
