"""Least-squares vertex baking (Kavan, Bargteil & Sloan 2011)."""
