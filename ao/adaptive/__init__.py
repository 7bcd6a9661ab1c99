"""How many rays at which points: to a tolerance, or as many as given."""
