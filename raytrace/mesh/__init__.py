"""Geometry in float64: meshes, normals, welding, placement in render space, precision."""
