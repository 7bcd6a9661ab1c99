"""Mesh files that stay on the disk: read and written in runs of rows."""
