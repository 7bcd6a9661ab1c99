"""All rays of a point through one hierarchy together, as they start at the same place."""
