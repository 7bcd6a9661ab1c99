"""Views of a bake: pages, reports, the clay look."""
