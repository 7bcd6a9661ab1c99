"""Bakes on more than one machine: traced in parts and merged, or by the workers of a cluster."""
