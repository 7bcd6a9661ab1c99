"""Wavefront OBJ with its material libraries; out with w as vertex colours."""
