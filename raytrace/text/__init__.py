"""Reading numbers and lines from the bytes of text files, in kernels."""
