"""Connected components, by union-find with path halving (Tarjan & van Leeuwen 1984).

Not scipy.sparse.csgraph, which takes five times as long for the faces of a mesh, most of it to make a graph of them.
"""

import numpy as np

from ..kernel.jit import inline, kernel
from ..types import AnyInts, Int64s


def connected_components(links: AnyInts, count: int) -> Int64s:
    """The component (count,) of each of `count` members, int64, numbered from 0 in the order of their first members.

    Args: links: (m, any), the members that each row connects.
    """
    parent = np.arange(count)
    join(links, parent)
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
    """Connect two members in the forest `parent` (count,), int64; roots are least."""
    a, b = _root(parent, a), _root(parent, b)
    parent[max(a, b)] = min(a, b)


@kernel
def join(links, parent):
    """Connect the members in each row of `links` (m, any) in the forest `parent`, as `connect` does two."""
    for row in range(len(links)):
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
