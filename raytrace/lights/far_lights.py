"""Lights so far away that they are directional in float32, where their squared distance may overflow."""

from math import hypot

import numpy as np

from ..kernel.vector import triple
from ..types import Float64s, Int64s
from . import layout as light_rows
from .kernels import incident

FAR = 2.0**24  # times the size of the scene: across it direction and attenuation change by less than a rounding


def make_far_lights_directional(kinds: Int64s, rows: Float64s) -> None:
    """Turn point and spot lights (k,), (k, light_rows.WIDTH) beyond `FAR` of the origin into directional ones in place.

    Their intensity becomes what arrives at the origin. Args: in render space.
    """
    for j, row in enumerate(rows):
        kind = int(kinds[j])
        if kind in (light_rows.POINT, light_rows.SPOT) and hypot(*triple(row, light_rows.POSITION)) > FAR:
            l, _, arriving = incident(kind, row, (0.0, 0.0, 0.0))
            row[: light_rows.DIFFUSE] = 0.0
            row[light_rows.INTENSITY : light_rows.INTENSITY + 3] = arriving
            row[light_rows.DIRECTION : light_rows.DIRECTION + 3] = np.negative(l)
            kinds[j] = light_rows.DIRECTIONAL
