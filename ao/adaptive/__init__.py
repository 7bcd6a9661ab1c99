"""Adaptive sampling: ray counts and points for a tolerance, or a number of rays that is given."""
