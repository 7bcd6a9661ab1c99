"""Embree's filter of hits on surfaces with alpha: holes are no hits, and shadow rays go on, attenuated.

A hit has an alpha (`raytrace.mesh.opacity`): the part of the place that is there, 0 in a hole. What is there may let
light through by its material, so that a share 1 − alpha · (opacity of the material) passes.
"""

import numpy as np

from ..brdf.material import ALPHA
from ..embree import END, FILTER_PATH, GEOM_ID, ID, INST_ID, NG_X, PRIM_ID, ROOM, TFAR, U, V, filtered
from ..kernel.jit import called_back, inline
from ..mesh.opacity import PackedOpacity, alpha
from ..types import Float64Rows, Int64s

STEP = np.float32(2.0**-17)  # in render space: 32 times what Embree's distances can be off
LEAST = 2.0**-16  # of the light: where less is left, nothing is
# Rows of a packet: the transmittance of a shadow ray, −1 of a viewing ray; the closest hit's alpha and the share that
# stops there; how many layers a shadow ray has met, and their distances.
TRANSMITTANCE, MET_ALPHA, STOPPED, COUNT, LAYERS = range(ROOM, ROOM + 5)


@called_back(*FILTER_PATH)
def filter_hits(call: int, opacity: PackedOpacity, first_face: Int64s, materials: Float64Rows) -> None:
    """Embree's filter, as `filtered` has it. Args: as in `raytrace.shade.layout.Geometry`."""
    valid, rays, hits, packet = filtered(call)
    ids = hits.view(np.int32)
    for k in range(len(valid)):
        if valid[k] != 0:
            # What of the light stops at the hit: alpha of the face there, times the material's opacity.
            lane = rays.view(np.int32)[ID, k]
            item = ids[INST_ID - NG_X, k] if ids[INST_ID - NG_X, k] >= 0 else ids[GEOM_ID - NG_X, k]
            face = first_face[item] + ids[PRIM_ID - NG_X, k]
            cover = np.float32(alpha(opacity, face, np.float64(hits[U - NG_X, k]), np.float64(hits[V - NG_X, k])))
            stopped = cover * np.float32(materials[item, ALPHA])
            # A hole is no hit; a shadow ray loses that light once, and ends when little is left.
            transmittance = packet[TRANSMITTANCE, lane]
            if transmittance < 0.0 < cover:  # a viewing ray ends at what is there
                packet[MET_ALPHA, lane] = cover
                packet[STOPPED, lane] = stopped
            elif transmittance < 0.0 or stopped == 0.0:
                valid[k] = 0
            elif stopped < 1.0:
                if note_layer(packet, lane, rays[TFAR, k]):
                    transmittance = transmittance * (np.float32(1.0) - stopped)
                    packet[TRANSMITTANCE, lane] = transmittance
                if transmittance > LEAST:
                    valid[k] = 0


@inline
def note_layer(packet, lane, distance):
    """Note a layer of a ray by its distance, in place of the oldest if all places are taken.

    Returns whether it is new: no layer is noted within STEP of it.
    """
    count = packet.view(np.int32)[COUNT, lane]
    for row in range(LAYERS, min(LAYERS + count, END)):
        if abs(packet[row, lane] - distance) < STEP:
            return False
    packet[LAYERS + count % (END - LAYERS), lane] = distance
    packet.view(np.int32)[COUNT, lane] = count + 1
    return True
