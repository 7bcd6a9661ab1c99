"""`obscurance bake` and `merge`: options, one input or many, in parts, by a cluster."""
