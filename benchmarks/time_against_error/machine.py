"""The machine on which a measurement was made."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from obscurance.ao.report import versions
from obscurance.raytrace.system.threads import thread_count


def machine() -> dict[str, Any]:
    """Processor, cores, threads, load before the start, system, and the versions of our own parts."""
    return {
        "cpu": _processor(),
        "cores": os.cpu_count(),
        "threads": thread_count(None),
        "load": os.getloadavg()[0],
        "system": platform.platform(),
        "versions": versions(),
    }


def _processor() -> str:
    """The processor's name where Linux tells it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
