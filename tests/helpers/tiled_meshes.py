"""Meshes in memory as sources of tiles."""

import numpy as np


class Arrays:
    """An `ao.tiles.source.TileSource` of arrays."""

    name = "arrays"

    def __init__(self, vertices, faces):
        self._vertices, self._faces = np.asarray(vertices, float), np.asarray(faces, np.int64)
        self.vertex_count, self.face_count = len(vertices), len(faces)

    def vertices(self, first, last):
        return self._vertices[first:last]

    def faces(self, first, last):
        return self._faces[first:last]
