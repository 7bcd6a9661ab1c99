"""Mesh files in and out, one file or folder a format."""
