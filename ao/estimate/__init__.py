"""Values of points: by a number of rays or to a tolerance, denoising, upsampling, interior points."""
