"""Places that let a part of a ray through: the layers of each ray of a point, nearest first.

A share α of a ray ends where it meets alpha α. Its hits are found in no order; 1 − μ is Σ αᵢ Π (1 − αⱼ) (1 − μ(dᵢ))
over the hits, with j before i. Of a ray that meets more layers than there is room for, the farthest are made one
(multi-layer alpha blending: Salvi & Vaidyanathan 2014). With the binary falloff, for which neither order nor distance
matter, one layer is enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import WIDE, bits, load_row
from obscurance.raytrace.kernel.vector import column, cross, dot, subtract
from obscurance.raytrace.mesh.opacity import PackedOpacity, alpha
from obscurance.raytrace.types import Float32Rows, Int64s

from ..mu import KernelMu, accumulate_occlusion, attenuation, depends_on_distance
from .ray_blocks import T_MISS, deactivate, is_active, note_side, shrink_t_max

LEAST = 2.0**-12  # of a ray: what is left of it where it ends
_MOST = 8


class AlphaHits(NamedTuple):
    """The layers that r rays of a point have passed.

    Attributes:
        opacity: of the tree's faces. counts: int64 (r,), layers of each ray.
        distances, alphas: float32 (r, l + 1), of the layers, with one more to sort in.
    """

    opacity: PackedOpacity
    counts: Int64s
    distances: Float32Rows
    alphas: Float32Rows

    @classmethod
    def of(cls, opacity: PackedOpacity | None, rays: int, falloff: KernelMu) -> AlphaHits | None:
        """Room for so many rays, None for opaque faces."""
        if opacity is None:
            return None
        shape = rays, (_MOST if falloff.tau > 0 or len(falloff.values) or falloff.columns else 1) + 1
        return cls(opacity, np.zeros(rays, np.int64), np.zeros(shape, np.float32), np.zeros(shape, np.float32))


@inline
def clear(layers):
    """Begin with a point, whose rays have passed nothing."""
    if layers is not None:
        layers.counts[:] = 0


@inline
def leaf_of(layers, tree, node, origin):
    """A leaf of a `BVH16` seen from a point, as `alpha_test` takes it; None where all is opaque."""
    if layers is None:
        return None
    return layers, tree.leaf_faces[node], tree.triangles[node], origin


@inline
def has_alpha(leaf, slot):
    """Whether the triangle in a slot of a leaf is not opaque everywhere and from both sides."""
    layers, faces, _, _ = leaf
    return layers.opacity.of[faces[slot]] >= 0 or layers.opacity.one_sided != 0


@inline
def alpha_test(leaf, rays, block, lane, slot, distance, closest, t_max):
    """Let a ray, lane of a block, meet the triangle in a slot of a leaf: end the ray there, or note a layer."""
    layers, faces, triangles, origin = leaf
    if closest and distance >= rays.t_hit[block, lane]:
        return
    v = column(rays.directions, block, len(rays.t_hit), lane)
    a = subtract(column(triangles, 0, 1, slot), origin)
    b = subtract(column(triangles, 3, 1, slot), origin)
    c = subtract(column(triangles, 6, 1, slot), origin)
    weight_a = dot(v, cross(b, c))
    weight_b = dot(v, cross(c, a))
    weight_c = dot(v, cross(a, b))
    total = weight_a + weight_b + weight_c  # v·2N: above 0 the ray meets the back
    if layers.opacity.of[faces[slot]] < 0:
        note_side(rays, block, lane, np.int64(total > 0.0), distance)
    if total > 0.0 and layers.opacity.one_sided != 0:
        return
    if total == 0.0:
        weight_a, weight_b, weight_c, total = 1.0, 1.0, 1.0, 3.0
    alpha_there = alpha(layers.opacity, faces[slot], weight_b / total, weight_c / total)
    if alpha_there > 0.0 and alpha_there < 1.0:
        left = _add(layers, WIDE * block + lane, distance, alpha_there)
        if closest or left > LEAST:
            return
    if alpha_there > 0.0:
        if closest:
            rays.t_hit[block, lane] = distance
            shrink_t_max(rays, block, t_max)
        else:
            deactivate(rays, block, 1 << lane)


@inline
def _add(layers, ray, distance, alpha_there):
    """Insert a layer; the part of the ray that goes on behind it, if there is room for one layer alone."""
    distances = layers.distances[ray]
    alphas = layers.alphas[ray]
    slot = layers.counts[ray]
    while slot > 0 and distances[slot - 1] > distance:
        distances[slot] = distances[slot - 1]
        alphas[slot] = alphas[slot - 1]
        slot -= 1
    distances[slot], alphas[slot] = distance, alpha_there
    last = layers.counts[ray]
    if last < len(distances) - 1:
        layers.counts[ray] = last + 1
        return 1.0 - alpha_there
    behind = (1.0 - alphas[last - 1]) * alphas[last]
    both = alphas[last - 1] + behind
    distances[last - 1] += behind / both * (distances[last] - distances[last - 1])
    alphas[last - 1] = both
    return 1.0 - both


@inline
def hit_mask(layers, rays, block, sent, closest):
    """The rays among `sent`, bits of a block, that may be occluded in part or whole."""
    if layers is not None:
        return sent
    return bits(load_row(rays.t_hit, block) < T_MISS) & sent if closest else sent & ~rays.active[block]


@inline
def write_occlusion(layers, rays, ray, falloff, columns, occlusion):
    """Write 1 − μ of a ray in a `hit_mask`, float64 (k,): by a `KernelMu`, or by each of its k `columns`."""
    occlusion[:] = 0.0
    if not depends_on_distance(falloff) and (layers is None or not is_active(rays, ray)):
        occlusion[0] = 1.0
        return
    t_hit, left = rays.t_hit[ray // WIDE, ray % WIDE], 1.0
    if layers is not None:
        for layer in range(layers.counts[ray]):
            distance = layers.distances[ray, layer]
            alpha_there = np.float64(layers.alphas[ray, layer])
            if distance >= t_hit:
                break
            _accumulate_at(distance, left * alpha_there, falloff, columns, occlusion)
            left *= 1.0 - alpha_there
    if t_hit < T_MISS:
        _accumulate_at(t_hit, left, falloff, columns, occlusion)


@inline
def _accumulate_at(distance, share, falloff, columns, occlusion):
    """Add 1 − μ of the share of a ray that ends at a distance, by a `KernelMu` or by each of its `columns`."""
    if columns is not None:
        accumulate_occlusion(columns, distance, share, occlusion)
    else:
        occlusion[0] += share * (1.0 - attenuation(distance, falloff) if depends_on_distance(falloff) else 1.0)
