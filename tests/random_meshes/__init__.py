"""Random meshes of many families, to test `--tolerance` on meshes that nothing was tuned on."""
