"""Stored w against independent rays."""
