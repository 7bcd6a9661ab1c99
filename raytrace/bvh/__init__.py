"""A hierarchy of sixteen triangles a leaf and sixteen boxes a node, for SIMD."""
