"""What hot loops are written in: compilation, SIMD vectors, 3-vectors, aligned arrays."""
