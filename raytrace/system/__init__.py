"""Files, memory, threads, and checked parameters."""
