"""Typed material parameters, presets, and reflection over arrays."""
