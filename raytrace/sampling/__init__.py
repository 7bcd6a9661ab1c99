"""Hashes, low-discrepancy points, and warps of them to directions."""
