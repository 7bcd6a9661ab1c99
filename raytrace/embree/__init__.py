"""The only door to Embree: its library, packets of rays, scenes, point queries."""
