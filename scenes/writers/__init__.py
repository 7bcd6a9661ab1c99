"""Mesh files out."""
