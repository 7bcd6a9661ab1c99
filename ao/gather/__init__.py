"""A hemisphere at a point: which points, from where, in which directions."""
