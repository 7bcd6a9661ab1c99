"""Kernels from a packet of camera rays to pixels."""
