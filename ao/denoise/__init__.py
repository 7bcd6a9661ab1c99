"""Denoising by neighbouring points, and upsampling to points that were not traced."""
