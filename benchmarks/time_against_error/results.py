"""The results as a file that people can read and compare: JSON, one line a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from obscurance.raytrace.system.atomic import atomic_write


def write_results(path: Path, results: dict[str, Any]) -> None:
    """Write `results`, whose `runs` are a list, whole or not at all."""
    head = json.dumps({key: value for key, value in results.items() if key != "runs"}, indent=1)
    runs = ",\n  ".join(json.dumps(run) for run in results["runs"])
    with atomic_write(path) as file:
        file.write(f'{head[:-2]},\n "runs": [\n  {runs}\n ]\n}}\n'.encode())
