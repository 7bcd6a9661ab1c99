"""Methods of sampling: all over the faces for a fit, at faces, on a finer mesh; vertices are in `ao/baking.py`."""
