"""Work in blocks, on threads, whose rows are kept on disk for a bake to go on from."""
