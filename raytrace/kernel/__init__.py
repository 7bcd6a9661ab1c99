"""Building blocks of hot loops: compilation, SIMD vectors, 3-vectors, aligned arrays, counting sort."""
