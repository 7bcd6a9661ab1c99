"""PLY, in and out."""
