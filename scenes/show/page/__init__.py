"""Pages that show a bake in a browser: one file, no network, opened from disk."""
