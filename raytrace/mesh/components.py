"""Connected components, by union-find with path halving (Tarjan & van Leeuwen 1984).

Not scipy.sparse.csgraph, which takes five times as long for the faces of a mesh, most of it to make a graph of them.
"""

import numpy as np

from ..kernel.jit import bound, inline, kernel
from ..kernel.simd import compare_and_swap
from ..system.threads import run_blocks, thread_count
from ..types import AnyInts, Int64s

_BLOCK, _MOST = 1 << 11, 32  # links, and blocks at once


def connected_components(links: AnyInts, count: int) -> Int64s:
    """The component (count,), from 0 in the order of first members, of `count` that the rows of `links` connect."""
    parent = np.arange(count)
    run_blocks(len(links), _BLOCK, bound(join, links, parent), thread_count(None), most=_MOST)
    number(parent)
    return parent


@inline
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@inline
def connect(parent, a, b):
    """Connect two members in the forest `parent` (count,), int64; roots are least, in whichever order they connect.

    On several threads at once: a root that another has connected meanwhile is looked for again.
    """
    while True:
        a, b = _root(parent, a), _root(parent, b)
        if a == b or compare_and_swap(parent, max(a, b), max(a, b), min(a, b)):
            break


@kernel
def join(links, parent, first, last):
    """Connect the members in each row of links[first:last], (m, any), in the forest `parent`, as `connect` does two."""
    for row in range(first, last):
        for k in range(1, links.shape[1]):
            connect(parent, links[row, 0], links[row, k])


@kernel
def number(parent):
    """Write the number of each member's component in place of its parent."""
    count = 0
    for i in range(len(parent)):  # parents come before their children
        if parent[i] == i:
            parent[i] = count
            count += 1
        else:
            parent[i] = parent[parent[i]]
