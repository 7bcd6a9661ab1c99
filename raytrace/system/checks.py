"""Checks before work begins: it fits into memory, its inputs are regular files, and its outputs replace none of them.

Where a system overcommits, an allocation does not fail: the process is killed in the middle of its work instead.
"""

import os
import re
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from ..errors import InputError, MemoryLimitError, OptionError, OutputError
from .atomic import PathName, check_writable

NEGLIGIBLE = 1 << 20  # bytes; finding out whether so few are available takes longer than work that needs them
_NO_LIMIT = 1 << 60  # kernels write about 2^63 for none
_ADDRESSES, _RESIDENT, _DATA = 0, 1, 5  # columns of /proc/self/statm
_UNTOUCHED = 640 << 20, 192 << 20  # addresses, private memory: reserved by libraries, stacks, arenas
_MOST = 1 << 28  # bytes of a report or scene; anything larger is none


def available_memory(root: Path = Path("/")) -> int | None:
    """Bytes of memory that the system, control groups and limits leave to this process; None if nothing can be read."""
    limits = [*_system(root / "proc"), *_control_groups(root), *_own_limits(root / "proc")]
    return max(min(limits), 0) if limits else None


def check_memory(source: object, needed: int, work: str, instead: dict[str, int] | None = None) -> None:
    """Refuse work, such as "to bake 8 vertices", that takes more than is available. Raises: MemoryLimitError.

    Args: needed: bytes beyond the memory in use. instead: bytes that other ways to reach the same need, best first.
    """
    free = available_memory() if needed > NEGLIGIBLE else None
    if free is None or needed <= free:
        return
    fitting = [f"{method} takes about {size_text(size)}" for method, size in (instead or {}).items() if size <= free]
    advice = fitting[0] if fitting else f"{free / needed:.0%} of that work would fit"
    raise MemoryLimitError(
        source, "memory", f"at most {size_text(free)}, what is available", f"about {size_text(needed)} {work}; {advice}"
    )


def memory_in_use(proc: Path = Path("/proc"), column: int = _RESIDENT) -> int | None:
    """Bytes of memory that this process holds, or what another `column` of Linux' `statm` says; None on other
    systems."""
    try:
        return int((proc / "self" / "statm").read_text().split()[column]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return None


def size_text(size: int) -> str:
    return f"{size / 2**30:.1f} GiB" if size >= 1 << 30 else f"{size / 2**20:.0f} MiB"


def _system(proc: Path) -> Iterator[int]:
    """Bytes that the system has to spare, or else all of its memory; nothing where neither can be read."""
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
            mount, limit_name, used_name, prefix = mounts, "memory.max", "memory.current", ""
        elif "memory" in controllers.split(","):
            mount, prefix = mounts / "memory", "total_"
            limit_name, used_name = "memory.limit_in_bytes", "memory.usage_in_bytes"
        else:
            continue
        # The group's limit and those of the groups above it.
        own_group = mount / path.lstrip("/")
        for folder in (own_group, *own_group.parents):
            with suppress(OSError, ValueError):
                limit = int((folder / limit_name).read_text())  # v2 has the word max where there is none
                if limit < _NO_LIMIT:
                    statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
                    files = sum(int(statistics.get(f"{prefix}{kind}_file", 0)) for kind in ("active", "inactive"))
                    yield limit - int((folder / used_name).read_text()) + files
            if folder == mount:
                break


def _own_limits(proc: Path) -> Iterator[int]:
    """Bytes left by `ulimit -v`, address space, and `ulimit -d`, private memory that can be written."""
    if sys.platform == "win32":
        return
    import resource

    resident = memory_in_use(proc) or 0
    kinds = (resource.RLIMIT_AS, _ADDRESSES), (resource.RLIMIT_DATA, _DATA)
    for (kind, column), untouched in zip(kinds, _UNTOUCHED, strict=True):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY:
            yield limit - resident - max((memory_in_use(proc, column) or 0) - resident, untouched)


def check_regular(path: Path, kind: str, fault: type[InputError] = InputError, source: str | None = None) -> None:
    """Refuse a path to anything but a regular file or a link to one. Raises: `fault`; OSError: it can't be looked at.

    Args: kind: what the message expects, such as "an image file". source: what it calls the file; by default `path`.
    """
    name = str(path) if source is None else source
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, ValueError):  # the latter of a name with a null byte
        raise fault(name, "file", "an existing file", "none") from None
    if not stat.S_ISREG(mode):
        what = "a folder" if stat.S_ISDIR(mode) else "something that is not a regular file"
        raise fault(name, "file", kind, what)


def _is_scene(content: bytes) -> object:
    """Whether a file's first bytes hold the objects of a TOML scene."""
    return re.search(rb"^[ \t]*(\[\[[ \t]*objects[ \t]*\]\]|objects[ \t]*=)", content, re.MULTILINE)


def _is_page(content: bytes) -> bool:
    """Whether a file begins as a page or report that this program wrote."""
    return b'<meta name="generator" content="obscurance' in content[:4096]


def _is_report(content: bytes) -> bool:
    """Whether a file begins as a report in JSON that this program wrote."""
    return content.lstrip()[:1] == b"{" and b'"versions"' in content and b'"obscurance"' in content


_KINDS: dict[tuple[str, ...], tuple[str, tuple[bytes, ...] | Callable[[bytes], object]]] = {
    (".npy",): ("a NumPy array", (b"\x93NUMPY",)),
    (".npz",): ("a NumPy archive", (b"PK\x03\x04", b"PK\x05\x06")),
    (".ply",): ("a PLY mesh", (b"ply\n", b"ply\r")),
    (".glb",): ("a GLB file", (b"glTF",)),
    (".exr",): ("an OpenEXR picture", (b"\x76\x2f\x31\x01",)),
    (".png",): ("a PNG picture", (b"\x89PNG\r\n\x1a\n",)),
    (".tif", ".tiff"): ("a TIFF picture", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    (".jpg", ".jpeg"): ("a JPEG picture", (b"\xff\xd8\xff",)),
    (".json",): ("a report of obscurance", _is_report),
    (".html",): ("a page of obscurance", _is_page),
    (".toml",): ("a scene", _is_scene),
}
"""Files that may be replaced, by their endings: a name, and their first bytes or a test of all of them."""


def check_outputs(outputs: Mapping[str, PathName | None], inputs: Iterable[PathName] = ()) -> None:
    """Check that all files of a command can be written without a loss. Raises: OptionError, OutputError.

    Names that lead to one file, by links of either sort or by another spelling, count as one. An existing file is
    replaced if it is empty or of the kind that its name's ending says, unless it is one of the `inputs`.

    Args: outputs: the files to write by what the user calls them, `--output` for instance; None: not asked for.
    """
    read = {_identity(path): path for path in inputs}
    written: dict[object, str] = {}
    for option, path in outputs.items():
        if path is None:
            continue
        check_writable(path)
        identity = _identity(path)
        if identity in read:
            other = os.fspath(read[identity])
            alias = "" if os.fspath(path) == other else f": {other}"
            raise OptionError(option, "a file that is not read", f"{os.fspath(path)}, an input{alias}")
        if identity in written:
            raise OptionError(option, f"another file than {written[identity]}", f"{os.fspath(path)}, the same file")
        written[identity] = option
        _check_kind(option, path)


def make_folder(folder: Path) -> None:
    """Make a folder for outputs, and its parents, unless it is there. Raises: OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        what = "it is a file" if isinstance(reason, FileExistsError) else reason.strerror
        raise OutputError(f"{folder}: cannot make this folder: {what}") from None


def check_ending(option: str, path: PathName, *endings: str) -> None:
    """Check that the name `path` ends in one of `endings`, upper or lower case. Raises: OptionError."""
    if Path(path).suffix.lower() not in endings:
        raise OptionError(option, f"a name ending in {' or '.join(endings)}", os.fspath(path))


def _identity(path: PathName) -> object:
    """Equal for names of one file: device and inode, or the whole path where there is no file."""
    try:
        status = os.stat(path)
        if status.st_ino:
            return status.st_dev, status.st_ino
    except (OSError, ValueError):
        pass
    return os.path.normcase(os.path.realpath(path))


def _check_kind(option: str, path: PathName) -> None:
    """Refuse to replace a file that is not of the kind of its ending. Raises: OptionError."""
    for endings, (name, is_one) in _KINDS.items():
        if Path(path).suffix.lower() not in endings or not os.path.exists(path):
            continue
        try:
            with open(path, "rb") as file:
                content = file.read(_MOST if callable(is_one) else 16)
            is_of_kind = is_one(content) if callable(is_one) else content.startswith(is_one)
            fault = None if is_of_kind or not content else f"{os.fspath(path)}, another kind of file"
        except OSError as reason:
            fault = f"{path}: {reason.strerror}"
        if fault:
            raise OptionError(option, f"a free name or {name} to replace", fault)
