"""Measurements, each one command, by what they measure; and the pictures of the documentation."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"
