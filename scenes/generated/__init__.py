"""Mesh families drawn from a seed, to judge a bake on meshes that nothing was tuned to."""
