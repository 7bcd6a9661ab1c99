"""What arrives at a point: light sources, and their kernels."""
