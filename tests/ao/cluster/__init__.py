"""Bakes and pictures by workers of a Dask cluster."""
