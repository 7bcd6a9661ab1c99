"""Exact w(p) of open and closed configurations."""
