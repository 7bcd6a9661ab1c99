"""Entry points, by which packages above offer functions for results of those below, which do not import them."""

from collections.abc import Callable
from typing import Any


def first_entry_point(group: str) -> Callable[..., Any] | None:
    """The function of the first entry point of a group, `obscurance.html` or `obscurance.save`, or None."""
    from importlib.metadata import entry_points

    for offer in entry_points(group=group):
        function: Callable[..., Any] = offer.load()
        return function
    return None
