"""Kernels that run over rows on threads, called with their arrays alone."""

from collections.abc import Callable
from typing import Any

from ..kernel.jit import Kernel, bind, inline
from .threads import granted, run_blocks, thread_count

_BLOCK, _MOST = 1 << 11, 32  # rows, and blocks at once


class Parallel(Kernel):
    """A kernel of the rows [start, stop), its last arguments; called without these it runs over all, on threads."""

    def __init__(self, function: Callable[..., Any], over: str, block: int, most: int, alone: bool) -> None:
        super().__init__(function)
        self._over = function.__code__.co_varnames.index(over)
        self._block, self._most, self._alone = block, most, alone

    def __call__(self, *arguments: Any, threads: int | None = None) -> None:
        """Run over all rows; `threads` None: as many as there are cores."""
        count, threads = len(arguments[self._over]), thread_count(threads)
        block = max(-(-count // granted(threads)), self._block) if self._alone else self._block
        run_blocks(count, block, self.bound(*arguments), threads, most=self._most)

    def bound(self, *arguments: Any) -> Callable[[int, int], None]:
        """What is called with a start and a stop, the arguments being looked through once."""
        return bind(self, *arguments)


def parallel(
    over: str, block: int = _BLOCK, most: int = _MOST, alone: bool = False
) -> Callable[[Callable[..., None]], Parallel]:
    """Decorator: a kernel f(…, start, stop) that is called as f(…) and runs on threads, each block by one of them.

    It writes only the rows of its block, so that results depend neither on threads nor on blocks.

    Args:
        over: the parameter whose rows they are. block: rows; up to `most` blocks are handed over at once.
        alone: one block for each thread, of `block` rows or more: for a kernel that looks at all rows in every block.
    """
    return lambda function: Parallel(function, over, block, 1 if alone else most, alone)


def each(over: str, block: int = _BLOCK, most: int = _MOST) -> Callable[[Callable[..., None]], Parallel]:
    """Decorator: `parallel` for a kernel of one row, f(row, …), which is called as f(…) and writes that row alone."""
    return lambda function: Parallel(_loop(function), over, block, most, False)


_LOOP = """
def enclosing(function):
    def {name}({others}, start, stop):
        for {row} in range(start, stop):
            function({row}, {others})
    return {name}
"""


def _loop(function: Callable[..., None]) -> Callable[..., None]:
    """A function of rows [start, stop), its last arguments, that calls one of a row, its first."""
    row, *others = function.__code__.co_varnames[: function.__code__.co_argcount]
    made: dict[str, Callable[..., Any]] = {}
    exec(_LOOP.format(name=function.__name__, row=row, others=", ".join(others)), function.__globals__, made)
    loop: Callable[..., None] = made["enclosing"](inline(function))
    hints = function.__annotations__
    loop.__doc__ = function.__doc__
    loop.__annotations__ = hints and {name: hints[name] for name in others} | {"start": int, "stop": int}
    return loop
