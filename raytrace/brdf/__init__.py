"""Reflection models (`raytrace.brdf.models`), what they share, and the dispatch over them."""
