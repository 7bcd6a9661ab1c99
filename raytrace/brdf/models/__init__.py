"""The reflection models, one a file: equations, sources, parameters, the row that kernels read, and the kernel."""
