"""Reports, pages, and what a browser draws of them."""
