"""What `obscurance bake` makes of its options."""
