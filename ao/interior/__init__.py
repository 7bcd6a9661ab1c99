"""Vertices inside closed parts: finding them, and filling them from visible ones."""
