"""Outlines of discs, cut by planes."""

import numpy as np

from obscurance.ao.points.outlines import CORNERS, _cut


def test_an_outline_that_rounding_has_made_zigzag_is_not_cut_into_more_corners_than_there_is_room_for():
    outlines = np.zeros((2, CORNERS, 2))
    count = 9
    zigzag = 1.0 + 1e-6 * (-1.0) ** np.arange(7)
    outlines[0, :count] = np.stack([[*zigzag, -1, -1], [*np.linspace(-1, 1, 7), 1, -1]], axis=1)
    before = outlines[0].copy()
    assert _cut(outlines, count, 1.0, 0.0, 1.0) == count  # which would have 12
    assert (outlines[0] == before).all()
    assert _cut(outlines, count, 0.0, 1.0, 0.99) <= CORNERS
    assert outlines[0, :, 1].max() == 0.99
