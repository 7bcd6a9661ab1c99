"""Bakes that are traced in parts, by processes that know nothing of each other, and merged."""
