"""A picture of w on its mesh: what notebooks show of a bake."""

from raytrace import AmbientLight, Camera, Lambert, Mesh, Object, Scene, Settings, Shape, render
from raytrace.types import Float64s

_SIZE = Settings(width=480, height=360, samples=4)


def bake_png(mesh: Mesh, w: Float64s) -> bytes:
    """A PNG of the mesh in ambient light times w (n,), as it stands (`Mesh.up`)."""
    white = Object(Shape(mesh, Lambert(albedo=(1, 1, 1), two_sided="viewer")), w=w)
    scene = Scene((white,), (AmbientLight(intensity=(1, 1, 1)),), background=(0.05, 0.05, 0.05))
    camera = Camera.framing(mesh, aspect=_SIZE.width / _SIZE.height)
    return render(scene, camera, _SIZE, layers=False)._repr_png_()
