"""Numerical stress tests: poses, contacts, defects, limits of float32."""
