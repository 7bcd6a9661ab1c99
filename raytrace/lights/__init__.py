"""Light sources, and kernels for the light that arrives at a point."""
