"""Values of points: rays as many as given or as a tolerance needs, denoising, upsampling, interior points."""
