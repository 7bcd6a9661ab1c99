"""Rays that start elsewhere than they should, for tests of what must notice it."""

from obscurance.raytrace.ray_origins import origins


def change_origins(monkeypatch, **functions):
    """Put other functions in place of those of `raytrace.ray_origins.origins`."""
    for name, function in functions.items():
        monkeypatch.setattr(origins, name, function)


def scaled_offsets(factor):
    """Functions by which rays start so many times as far from the surface."""
    offsets_and_reaches = origins.offsets_and_reaches
    ray_offset = origins.ray_offset

    def scaled(*arguments):
        offset, touching, reach = offsets_and_reaches(*arguments)
        return factor * offset, touching, reach

    return {"offsets_and_reaches": scaled, "ray_offset": lambda *arguments: factor * ray_offset(*arguments)}
