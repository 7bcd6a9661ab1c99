"""Kernels that run over rows on threads, called with their arrays alone."""

from collections.abc import Callable
from typing import Any, Concatenate, Generic, ParamSpec

from ..kernel.jit import Kernel, inline
from .threads import granted, run_blocks, thread_count

_BLOCK, _MOST = 1 << 11, 32  # rows, and blocks at once
P = ParamSpec("P")


class Parallel(Kernel, Generic[P]):
    """A kernel of the rows [start, stop), its first arguments; called without these it runs over all, on threads."""

    def __init__(self, function: Callable[..., None], over: str, block: int, alone: bool) -> None:
        super().__init__(function)
        self._over = function.__code__.co_varnames.index(over) - 2
        self._block, self._alone = block, alone

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> None:
        """Run over all rows, on as many threads as there are cores."""
        self.on(None)(*arguments, **named)

    def on(self, threads: int | None) -> Callable[P, None]:
        """The kernel on so many threads, but on no more than there are whole blocks: to wake one takes longer."""

        def run(*arguments: Any) -> None:
            count = len(arguments[self._over])
            used = min(granted(thread_count(threads)), count // self._block or 1)
            block = -(-count // used) or 1 if self._alone else self._block
            run_blocks(count, block, self.for_rows(*arguments), used, most=1 if self._alone else _MOST)

        return run  # type: ignore[return-value]


def parallel(
    over: str, block: int = _BLOCK, alone: bool = False
) -> Callable[[Callable[Concatenate[int, int, P], None]], Parallel[P]]:
    """Decorator: a kernel f(start, stop, …) that is called as f(…) and runs on threads, each block by one of them.

    It writes only the rows of its block, so that results depend neither on threads nor on blocks.

    Args:
        over: the parameter whose rows they are. block: rows.
        alone: one block for each thread, of `block` rows or more: for a kernel that looks at all rows in every block.
    """
    return lambda function: Parallel(function, over, block, alone)


def each(over: str, block: int = _BLOCK) -> Callable[[Callable[Concatenate[int, P], None]], Parallel[P]]:
    """Decorator: `parallel` for a kernel of one row, f(row, …), which is called as f(…) and writes that row alone."""
    return lambda function: Parallel(_loop(function), over, block, False)


_LOOP = """
def enclosing(function):
    def {name}(start, stop, {others}):
        for {row} in range(start, stop):
            function({row}, {others})
    return {name}
"""


def _loop(function: Callable[Concatenate[int, P], None]) -> Callable[Concatenate[int, int, P], None]:
    """A function of the rows [start, stop), its first arguments, that calls one of a row."""
    row, *others = function.__code__.co_varnames[: function.__code__.co_argcount]
    made: dict[str, Callable[..., Any]] = {}
    exec(_LOOP.format(name=function.__name__, row=row, others=", ".join(others)), function.__globals__, made)
    loop: Callable[..., None] = made["enclosing"](inline(function))
    hints = function.__annotations__
    loop.__doc__ = function.__doc__
    loop.__annotations__ = hints and {"start": int, "stop": int} | {name: hints[name] for name in others}
    return loop
