"""What is reflected: one local illumination model a file, and the dispatch over them."""
