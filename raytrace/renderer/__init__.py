"""From a scene to a frame."""
