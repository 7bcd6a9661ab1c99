"""Bake time against error, ours and the peers' side by side: JSON, tables and plots.

    python -m benchmarks.time_against_error [--quick | --dense] [--meshes FOLDER] [--peer NAME=PYTHON …]

Results go to benchmarks/results/time_against_error.json, tables and plots to docs/benchmarks; with --quick both go to
build/time_against_error, with --dense to time_against_error_dense.json and docs/benchmarks/dense. A peer runs by its
own interpreter, the one given or the one that `make peers` has made; those without are left out. docs/benchmarks.md
tells how it is measured and why.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from .analysis import TARGETS
from .machine import machine
from .measure import Plan, measure_mesh, warm_up
from .methods import DENSE, METHODS
from .present import present
from .programs import open_programs, peer_option
from .results import write_results
from .suite import MANY, builtin, from_folder

ROOT = Path(__file__).parent.parent.parent
FULL = Plan(rounds=3, reference_rays=16384, reference_vertices=8192, patience=1.0)
QUICK = Plan(rounds=2, reference_rays=8192, reference_vertices=2048, patience=0.2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few meshes, few rays: minutes rather than half an hour")
    parser.add_argument("--dense", action="store_true", help="only the densest meshes, ours against Mitsuba's best")
    parser.add_argument("--meshes", type=Path, metavar="FOLDER", help="also the mesh files in this folder")
    parser.add_argument("--patience", type=float, default=1.0, help="a factor on the time that methods may take")
    peer_option(parser)
    arguments = parser.parse_args()
    start = time.perf_counter()
    plan = QUICK if arguments.quick else FULL
    plan = replace(plan, patience=plan.patience * arguments.patience)
    specimens = builtin(arguments.quick) + (from_folder(arguments.meshes, arguments.quick) if arguments.meshes else [])
    specimens = [each for each in specimens if (each.dense and len(each.make().vertices) >= MANY) == arguments.dense]
    if arguments.quick:
        results_folder = docs_folder = ROOT / "build" / "time_against_error"
    else:
        results_folder, docs_folder = ROOT / "benchmarks" / "results", ROOT / "docs" / "benchmarks"
    if arguments.dense:
        docs_folder /= "dense"
    for folder in (results_folder, docs_folder):
        folder.mkdir(parents=True, exist_ok=True)
    target = results_folder / f"time_against_error{'_dense' if arguments.dense else ''}.json"
    with open_programs(dict(arguments.peer)) as (programs, missing):
        for name, reason in missing.items():
            print(f"{name} is left out: {reason}")
        methods = [method for method in (DENSE if arguments.dense else METHODS) if method.program in programs]
        results: dict[str, Any] = {
            "form": "quick" if arguments.quick else "dense" if arguments.dense else "full",
            "machine": machine(),
            "versions": {name: program.version for name, program in programs.items()},
            "missing": missing,
            "plan": asdict(plan),
            "targets": TARGETS,
            "methods": [asdict(method) for method in methods],
            "meshes": [],
            "runs": [],
        }
        warm_up(programs, methods)
        for specimen in specimens:
            about, runs = measure_mesh(specimen, programs, methods, plan, lambda text: print(text, flush=True))
            results["meshes"].append(about)
            results["runs"] += runs
            results["minutes"] = (time.perf_counter() - start) / 60
            write_results(target, results)
    print(f"\n{present(results, docs_folder)}\n{target}, {docs_folder}: {results['minutes']:.1f} minutes")


if __name__ == "__main__":
    main()
