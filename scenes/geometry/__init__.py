"""Geometry in memory: polygons, instances, attributes, primitives, built-in shapes."""
