"""Blocks of work on threads: progress, Ctrl-C and results that don't depend on the number of threads.

Threads stay for later calls: to start one takes five times as long as to wake one, and a bake has some forty calls.
Not concurrent.futures, whose pool fails where the system grants fewer threads than asked for: here the calling thread
works too, so one is enough, and an interrupt waits for no more than the blocks at work (evidence/reliability.md).
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from queue import Empty, SimpleQueue

from ..errors import OptionError

MAX_THREADS = 4096
_within = threading.local()  # its `call`: of `run_blocks`, for which this thread is at work
_PARTS = 2  # of what is left, for each thread, the largest share handed over at once
_BEYOND = 1  # threads more than cores, at most: others would only take turns, and fill address space
_WAKES = 2  # threads that each thread wakes, so that all of many are soon awake


def thread_count(threads: int | None) -> int:
    """`threads`, or the number of cores this process may use for None. Raises: OptionError."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= MAX_THREADS:
        raise OptionError("threads", f"a whole number from 1 to {MAX_THREADS}", threads)
    return threads


def granted(threads: int) -> int:
    """How many threads `run_blocks` uses of so many that are asked for: no more than cores, and one within a block."""
    return 1 if getattr(_within, "call", None) else min(threads, thread_count(None) + _BEYOND)


def shares(count: int, block: int, threads: int, most: int = 1) -> Iterator[tuple[int, int]]:
    """The parts [start, stop) of [0, count) that `run_blocks` hands over, one after another.

    Each is up to `most` blocks, as long as that is at most half of a thread's part of what is left: few at first, and
    at the end so short that no thread waits long for the last (guided self-scheduling, Polychronopoulos & Kuck 1987).
    """
    start = 0
    while start < count:
        size = block * max(min((count - start) // (_PARTS * threads * block), most), 1)
        yield start, min(start + size, count)
        start += size


def run_blocks(
    count: int,
    block: int,
    work: Callable[[int, int], None],
    threads: int,
    progress: Callable[[int], None] | None = None,
    most: int = 1,
) -> None:
    """Call `work(start, stop)` over [0, count) in blocks, up to `most` at once, on this thread and others.

    `work` must release the GIL to gain anything and write only its own rows. `progress` is called, on this thread,
    with the number of items of each finished block. An exception or Ctrl-C drops the blocks that have not begun.
    A call within `work` stays on its thread: all threads are at work already. Where that around it has failed, it ends
    by KeyboardInterrupt.
    """
    threads = min(granted(threads), -(-count // block))
    parts = shares(count, block, max(threads, 1), most)
    if threads <= 1:  # the bake of a small mesh has dozens of calls; a queue would take as long as their work
        around = getattr(_within, "call", None)
        for start, stop in parts:
            if around and around.over:
                raise KeyboardInterrupt
            work(start, stop)
            if progress:
                progress(stop - start)
        return
    # Other threads take blocks beside this one, which alone reports what is finished.
    call = _Call(parts, work)
    left, busy = count, True
    try:
        _team.ask(call, threads - 1)
        while left > 0:
            busy = busy and call.work_one()
            for size in _queued(call.finished, wait=not busy):
                if isinstance(size, BaseException):
                    raise size
                left -= size
                if progress:
                    progress(size)
    finally:
        _team.dismiss(call)
        call.over = True
        while call.helping and left > 0:  # if all is done, they only have to notice it
            for _ in _queued(call.finished, wait=True):
                pass


class _Call:
    """A call of `run_blocks`."""

    def __init__(self, parts: Iterator[tuple[int, int]], work: Callable[[int, int], None]) -> None:
        self.finished: SimpleQueue[int | BaseException] = SimpleQueue()  # sizes of finished blocks, and failures
        self.over = False  # no more blocks are to begin
        self.helping = 0  # threads at work beside the one that called
        self._parts, self._work, self.taking = parts, work, threading.Lock()

    def work_one(self) -> bool:
        """Do the next block, if there is one."""
        with self.taking:
            part = None if self.over else next(self._parts, None)
        if part is None:
            return False
        _within.call = self
        try:
            self._work(*part)
        finally:
            _within.call = None
        self.finished.put(part[1] - part[0])
        return True

    def help(self) -> None:
        """Do blocks as long as there are some, and be one helper less."""
        failure: BaseException | None = None
        try:
            while self.work_one():
                pass
        except BaseException as reason:
            failure = reason
        with self.taking:
            self.helping -= 1
        if failure or self.over:
            self.finished.put(failure or 0)


class _Team:
    """Threads that wait for work until the process ends; a process that is forked begins with none."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: deque[_Call] = deque()  # calls to be helped, once for each thread wanted
        self._idle: list[threading.Lock] = []  # what threads wait for
        self._wanted: dict[_Call, int] = {}  # how many threads each call of this moment wants
        self._there = 0  # threads

    def ask(self, call: _Call, threads: int) -> None:
        """Have so many threads help; a system short of memory or of processes grants fewer."""
        with self._lock:
            self._wanted[call] = threads
            self._asked.extend([call] * threads)
            missing = sum(self._wanted.values()) - self._there
            self._there += max(missing, 0)
        for started in range(missing):
            try:
                threading.Thread(target=self._serve, daemon=True).start()
            except RuntimeError:
                with self._lock:
                    self._there -= missing - started
                break
        self._wake()

    def dismiss(self, call: _Call) -> None:
        """Withdraw what `ask` began: threads that have not started never will."""
        with self._lock:
            self._wanted.pop(call, None)
            self._asked = deque(other for other in self._asked if other is not call)

    def _wake(self) -> None:
        """Wake idle threads for the calls that wait for help, a few at a time; these wake more."""
        with self._lock:
            for _ in range(min(_WAKES, len(self._asked), len(self._idle))):
                self._idle.pop().release()

    def _serve(self) -> None:
        """What each thread of the team does: help with the next call, or wait for one."""
        waiting = threading.Lock()
        waiting.acquire()
        while True:
            with self._lock:
                call = self._asked.popleft() if self._asked else None
                if call:
                    with call.taking:
                        call.helping += 1
                else:
                    self._idle.append(waiting)
            if call:
                self._wake()
                call.help()
                del call  # and with it what the work refers to
            else:
                waiting.acquire()


_team = _Team()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_team.__init__)  # type: ignore[misc]


def _queued(finished: SimpleQueue[int | BaseException], wait: bool) -> Iterator[int | BaseException]:
    """Items of a queue: all that are there, or if none are, and `wait`, those of the next tenth of a second, after
    which Ctrl-C gets in."""
    try:
        yield finished.get(wait, 0.1)
        while True:
            yield finished.get_nowait()
    except Empty:
        return
