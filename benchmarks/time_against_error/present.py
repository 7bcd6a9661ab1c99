"""Tables and plots of results. To make them again from the file:

python -m benchmarks.time_against_error.present RESULTS.json FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from .analysis import curves
from .plots import plot
from .tables import tables


def present(results: dict[str, Any], folder: Path) -> str:
    """Write tables.md and the plots into `folder`. Returns: the tables."""
    found = curves(results["runs"])
    text = tables(results, found)
    (folder / "tables.md").write_text(text)
    plot(results, found, folder)
    return text


if __name__ == "__main__":
    print(present(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2])))
