"""Scenes × files × kinds of point × options, drawn by a seed and run through the command, against a slow caster."""
