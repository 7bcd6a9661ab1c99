"""How tests are shared out, the random meshes' seed, and what several folders' tests look at."""

from __future__ import annotations

import errno
import gc
import io
import os
import secrets
import sys
import webbrowser
from collections.abc import Callable, Generator
from contextlib import suppress
from pathlib import Path
from pkgutil import resolve_name
from types import SimpleNamespace
from typing import Any

import pytest

# hundreds of processes start: what the first compiles of Python is kept for the others, whatever the environment says
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# every core has a process already: threads of linear algebra would wait for each other, at ten times the cost
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("random meshes")
    group.addoption("--mesh-seed", type=int, metavar="SEED", help="seed of the random meshes, to draw them once more")


def pytest_configure(config: pytest.Config) -> None:
    if config.option.mesh_seed is None:  # the processes of pytest-xdist have this one's
        config.option.mesh_seed = secrets.randbelow(1 << 31)


def pytest_report_header(config: pytest.Config) -> str:
    return f"random meshes: --mesh-seed {config.option.mesh_seed}"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Modules and tests stay to the end: the garbage collector, which some tests call, need not look through them."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.fixture
def available_memory(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A function: let so many bytes be available, or what a function says, for all checks or a module that asks."""

    def let(size: int | Callable[[], int] | None, module: str = "obscurance.raytrace.system.checks") -> None:
        monkeypatch.setattr(f"{module}.available_memory", size if callable(size) else lambda: size)

    return let


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[tuple[Any, ...]]]:
    """A function: the positional arguments of each call, from now on, of what has this dotted name."""

    def watch(name: str) -> list[tuple[Any, ...]]:
        function = resolve_name(name)
        calls: list[tuple[Any, ...]] = []

        def watched(*arguments: Any, **named: Any) -> Any:
            calls.append(arguments)
            return function(*arguments, **named)

        monkeypatch.setattr(name, watched)
        return calls

    return watch


@pytest.fixture
def fail_call(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A function: let a function of `os` fail from now on, as on a full disk."""

    def let(name: str, code: int = errno.ENOSPC) -> None:
        def fail(*_arguments: object) -> None:
            raise OSError(code, os.strerror(code))

        monkeypatch.setattr(os, name, fail)

    return let


@pytest.fixture
def standard_input(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A function: let standard input have this content, from a pipe or a terminal."""

    def give(content: bytes, terminal: bool = False) -> None:
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(content), isatty=lambda: terminal))

    return give


@pytest.fixture
def shown_in_browser(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that the browser was to show."""
    addresses: list[str] = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    return addresses


@pytest.fixture
def entry_points(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[object]]:
    """What installed packages offer, by group: nothing."""
    offers: dict[str, list[object]] = {}
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: offers.get(group, []))
    return offers


@pytest.fixture(scope="session")
def demonstration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that `obscurance demo` makes, of a coarse temple in a small picture; processes of pytest-xdist share
    it.
    """
    from command import succeeded

    from obscurance.raytrace import Settings
    from obscurance.scenes.commands import demo
    from obscurance.scenes.geometry.builtin_shapes import temple

    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "demonstration"
    if not shared.exists():
        folder = tmp_path_factory.mktemp("demonstration") / "demo"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(demo, "_HALF", Settings(width=180, height=140))
            patch.setattr(demo, "temple", lambda: temple(fineness=0.6))
            succeeded("demo", "-o", folder)
        with suppress(OSError):  # another has been faster
            folder.rename(shared)
    return shared


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One process more than cores: some tests wait, for workers, browsers and commands that they start."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Each process begins with a part of the folders, so that few kernels are compiled by two at once, and takes tests
    from others when it has done its own.
    """
    if config.getvalue("dist") != "load":
        return None
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)
