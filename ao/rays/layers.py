"""Places that let a part of a ray through: the layers of each ray of a point, nearest first.

A share α of a ray ends where it meets alpha α. Its hits are found in no order; 1 − μ is Σ αᵢ Π (1 − αⱼ) (1 − μ(dᵢ))
over them, with j before i. Of a ray that meets more layers than there is room for, the farthest are made one
(multi-layer alpha blending: Salvi & Vaidyanathan 2014). With the binary falloff, for which neither order nor distance
matter, one is enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.kernel.jit import inline
from raytrace.kernel.simd import WIDE, bits, load_row
from raytrace.kernel.vector import column, cross, dot, subtract
from raytrace.mesh.opacity import PackedOpacity, alpha
from raytrace.types import Float32s, Int64s

from ..mu import KernelMu, add_losses, faded, fades
from .ray_blocks import T_MISS, deactivate, is_active, shrink_t_max

LEAST = 2.0**-12  # of a ray: what is left of it where it ends
_MOST = 8


class Layers(NamedTuple):
    """The layers that r rays of a point have passed.

    Attributes:
        opacity: of the tree's faces. counts: int64 (r,), layers of each ray.
        distances, alphas: float32 (r, l + 1), of the layers, with a place to sort in.
    """

    opacity: PackedOpacity
    counts: Int64s
    distances: Float32s
    alphas: Float32s

    @classmethod
    def of(cls, opacity: PackedOpacity | None, rays: int, falloff: KernelMu) -> Layers | None:
        """Room for so many rays, None for opaque faces."""
        if opacity is None:
            return None
        shape = rays, (_MOST if falloff.tau > 0 or len(falloff.values) or falloff.columns else 1) + 1
        return cls(opacity, np.zeros(rays, np.int64), np.zeros(shape, np.float32), np.zeros(shape, np.float32))


@inline
def clear(layers):
    if layers is not None:
        layers.counts[:] = 0


@inline
def leaf_of(layers, tree, node, origin):
    """A leaf of a `BVH16` seen from a point, as `pass_through` takes it; None where all is opaque."""
    if layers is None:
        return None
    return layers, tree.rows[node], tree.triangles[node], origin


@inline
def has_alpha(leaf, place):
    """Whether the triangle at a place of a leaf is not opaque everywhere and from both sides."""
    layers, faces, _, _ = leaf
    return layers.opacity.of[faces[place]] >= 0 or layers.opacity.one_sided != 0


@inline
def pass_through(leaf, rays, block, lane, place, distance, closest, t_max):
    """Let a ray, lane of a block, meet the triangle at a place of a leaf: end it there, or note a layer."""
    layers, faces, triangles, origin = leaf
    if closest and distance >= rays.t_hit[block, lane]:
        return
    v = column(rays.directions, block, len(rays.t_hit), lane)
    a = subtract(column(triangles, 0, 1, place), origin)
    b = subtract(column(triangles, 3, 1, place), origin)
    c = subtract(column(triangles, 6, 1, place), origin)
    first = dot(v, cross(b, c))
    second = dot(v, cross(c, a))
    third = dot(v, cross(a, b))
    total = first + second + third  # v·2N: above 0 the ray meets the back
    if total > 0.0 and layers.opacity.one_sided != 0:
        return
    if total == 0.0:
        first, second, third, total = 1.0, 1.0, 1.0, 3.0
    found = alpha(layers.opacity, faces[place], second / total, third / total)
    if found > 0.0 and found < 1.0:
        left = _add(layers, WIDE * block + lane, distance, found)
        if closest or left > LEAST:
            return
    if found > 0.0:
        if closest:
            rays.t_hit[block, lane] = distance
            shrink_t_max(rays, block, t_max)
        else:
            deactivate(rays, block, 1 << lane)


@inline
def _add(layers, ray, distance, found):
    """Insert a layer; the part of the ray that goes on behind it, if there is room for one layer alone."""
    distances = layers.distances[ray]
    alphas = layers.alphas[ray]
    place = layers.counts[ray]
    while place > 0 and distances[place - 1] > distance:
        distances[place] = distances[place - 1]
        alphas[place] = alphas[place - 1]
        place -= 1
    distances[place], alphas[place] = distance, found
    last = layers.counts[ray]
    if last < len(distances) - 1:
        layers.counts[ray] = last + 1
        return 1.0 - found
    behind = (1.0 - alphas[last - 1]) * alphas[last]
    both = alphas[last - 1] + behind
    distances[last - 1] += behind / both * (distances[last] - distances[last - 1])
    alphas[last - 1] = both
    return 1.0 - both


@inline
def rays_that_met(layers, rays, block, sent, closest):
    """The rays among `sent`, bits of a block, that may be occluded in part or whole."""
    if layers is not None:
        return sent
    return bits(load_row(rays.t_hit, block) < T_MISS) & sent if closest else sent & ~rays.active[block]


@inline
def lose(layers, rays, ray, falloff, columns, losses):
    """Write 1 − μ of a ray of those `rays_that_met`, float64 (k,): by a `KernelMu`, or by each of its k `columns`."""
    losses[:] = 0.0
    if not fades(falloff) and (layers is None or not is_active(rays, ray)):
        losses[0] = 1.0
        return
    t_hit, left = rays.t_hit[ray // WIDE, ray % WIDE], 1.0
    if layers is not None:
        for layer in range(layers.counts[ray]):
            distance = layers.distances[ray, layer]
            found = np.float64(layers.alphas[ray, layer])
            if distance >= t_hit:
                break
            _lose_at(distance, left * found, falloff, columns, losses)
            left *= 1.0 - found
    if t_hit < T_MISS:
        _lose_at(t_hit, left, falloff, columns, losses)


@inline
def _lose_at(distance, share, falloff, columns, losses):
    if columns is not None:
        add_losses(columns, distance, share, losses)
    else:
        losses[0] += share * (1.0 - faded(distance, falloff) if fades(falloff) else 1.0)
