"""A check that work fits into memory, made before it begins.

Where a system overcommits, an allocation does not fail: the process is killed in the middle of its work instead.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from ..errors import MemoryLimitError

NEGLIGIBLE = 1 << 20  # bytes; finding out whether so few are available takes longer than work that needs them
_NO_LIMIT = 1 << 60  # kernels write about 2^63 for none
_ADDRESSES, _RESIDENT, _DATA = 0, 1, 5  # columns of /proc/self/statm
_UNTOUCHED = 640 << 20, 192 << 20  # addresses, private memory: reserved by libraries, stacks, arenas


def available(root: Path = Path("/")) -> int | None:
    """Bytes that this process can still fill: the least of what the system, control groups and its own limits leave.

    None if nothing can be read. Args: root: where `proc` and `sys` are.
    """
    limits = [*_system(root / "proc"), *_control_groups(root), *_own_limits(root / "proc")]
    return max(min(limits), 0) if limits else None


def check_memory(source: object, needed: int, work: str, instead: dict[str, int] | None = None) -> None:
    """Refuse work that does not fit.

    Args:
        source: what to name in the message. needed: bytes beyond the memory in use. work: such as "to bake 8 vertices".
        instead: bytes that other ways to reach the same need, by name, best first.

    Raises:
        MemoryLimitError: less than `needed` is available.
    """
    free = available()
    if free is None or needed <= free:
        return
    fitting = [f"{way} takes about {size_text(size)}" for way, size in (instead or {}).items() if size <= free]
    advice = fitting[0] if fitting else f"{free / needed:.0%} of that work would fit"
    raise MemoryLimitError(
        source, "memory", f"at most {size_text(free)}, what is available", f"about {size_text(needed)} {work}; {advice}"
    )


def in_use(proc: Path = Path("/proc")) -> int | None:
    """Bytes that this process holds now; None where the system does not say."""
    return _pages(proc, _RESIDENT)


def size_text(size: int) -> str:
    return f"{size / 2**30:.1f} GiB" if size >= 1 << 30 else f"{size / 2**20:.0f} MiB"


def _system(proc: Path) -> Iterator[int]:
    try:
        fields = dict(line.split(":") for line in (proc / "meminfo").read_text().splitlines())
        yield int(fields["MemAvailable"].split()[0]) << 10
    except (OSError, KeyError, ValueError):
        if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
            yield os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _control_groups(root: Path) -> Iterator[int]:
    """Bytes left by the process's own control group and each above it, v1 and v2; pages of files count as free."""
    mounts = root / "sys" / "fs" / "cgroup"
    try:
        groups = (root / "proc" / "self" / "cgroup").read_text().splitlines()
    except OSError:
        return
    for group in groups:
        _, controllers, path = group.split(":", 2)
        if controllers == "":
            mount, names = mounts, ("memory.max", "memory.current", "")
        elif "memory" in controllers.split(","):
            mount = mounts / "memory"
            names = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"
        else:
            continue
        own = mount / path.lstrip("/")
        for folder in (own, *own.parents):
            yield from _remaining(folder, *names)
            if folder == mount:
                break


def _remaining(folder: Path, limit: str, used: str, prefix: str) -> Iterator[int]:
    try:
        limit_bytes = int((folder / limit).read_text())  # v2 has the word max where there is none
        if limit_bytes < _NO_LIMIT:
            statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
            files = sum(int(statistics.get(f"{prefix}{kind}_file", 0)) for kind in ("active", "inactive"))
            yield limit_bytes - int((folder / used).read_text()) + files
    except (OSError, ValueError):
        return


def _own_limits(proc: Path) -> Iterator[int]:
    """Bytes left by `ulimit -v`, address space, and `ulimit -d`, private memory that can be written."""
    if sys.platform == "win32":
        return
    import resource

    resident = _pages(proc, _RESIDENT) or 0
    kinds = (resource.RLIMIT_AS, _ADDRESSES), (resource.RLIMIT_DATA, _DATA)
    for (kind, column), untouched in zip(kinds, _UNTOUCHED, strict=True):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY:
            yield limit - resident - max((_pages(proc, column) or 0) - resident, untouched)


def _pages(proc: Path, column: int) -> int | None:
    """Bytes that a column of `statm` says, None without one."""
    try:
        return int((proc / "self" / "statm").read_text().split()[column]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return None
