"""Reflection models: one a file, with its formula and paper, and the dispatch over them.

`terms` of a model are the diffuse and the specular RGB that a packed row reflects of unit incident RGB, for n·l > 0.
"""
