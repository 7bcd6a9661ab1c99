"""Gathering at many points: threads, and checkpoints to resume from."""
