"""Alpha where a ray meets a face, for kernels."""

from ..image.texture_lookup import blend, neighbours
from ..kernel.jit import inline, kernel


@inline
def alpha(opacity, face, u, v):
    """Opacity in [0, 1] of a place on a face, 0 or 1 where the surface has a cutoff. Args: u, v: as Embree has them."""
    surface = opacity.of[face]
    if surface < 0:
        return 1.0
    a, first = opacity.factor[surface], 1.0 - u - v
    if len(opacity.corners) > 0:
        at = opacity.corners[face]
        a *= first * at[0] + u * at[1] + v * at[2]
    if opacity.images[surface, 1] > 0:
        at = opacity.uv[face]
        s = first * at[0, 0] + u * at[1, 0] + v * at[2, 0]
        t = first * at[0, 1] + u * at[1, 1] + v * at[2, 1]
        a *= _texture_alpha(opacity.texels, opacity.images[surface], s, t)
    if opacity.cutoff[surface] < 0.0:
        return min(max(a, 0.0), 1.0)
    return 1.0 if a >= opacity.cutoff[surface] else 0.0


@inline
def _texture_alpha(texels, image, u, v):
    """Bilinear alpha of an image of `PackedOpacity` at texture coordinates."""
    start, width, height = image[0], image[1], image[2]
    left, right, s = neighbours(u, width, image[3])
    upper, lower, t = neighbours(1.0 - v, height, image[4])
    upper, lower = start + upper * width, start + lower * width
    return blend(texels, upper + left, upper + right, lower + left, lower + right, s, t, 0)


@kernel
def alphas(opacity, faces, places, out):
    """Write the opacity (k,) at barycentric places (k, 2) of faces (k,)."""
    for row in range(len(faces)):
        out[row] = alpha(opacity, faces[row], places[row, 0], places[row, 1])
