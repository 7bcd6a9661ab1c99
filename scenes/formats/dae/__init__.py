"""COLLADA, by the optional library pycollada."""
