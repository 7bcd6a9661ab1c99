"""What neighbouring points tell: shrinkage, and upsampling of points that were not traced."""
