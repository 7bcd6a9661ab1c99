"""Reflection models: one a file, with its formula and paper, and the dispatch over them."""
