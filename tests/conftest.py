"""The random meshes' seed, fresh at each run unless it is given, and meshes in place of the built-in shapes."""

from __future__ import annotations

import secrets

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("random meshes")
    group.addoption("--mesh-seed", type=int, metavar="SEED", help="seed of the random meshes, to draw them once more")
    group.addoption("--mesh", action="append", default=[], metavar="FILE", help="mesh to damage; can be repeated")


def pytest_configure(config: pytest.Config) -> None:
    if config.option.mesh_seed is None:  # the processes of pytest-xdist have this one's
        config.option.mesh_seed = secrets.randbelow(1 << 31)


def pytest_report_header(config: pytest.Config) -> str:
    return f"random meshes: --mesh-seed {config.option.mesh_seed}"
