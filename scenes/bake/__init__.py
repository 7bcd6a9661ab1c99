"""`obscurance bake`: options, one input or many, by a cluster."""
