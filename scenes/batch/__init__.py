"""Many meshes baked by one command."""
