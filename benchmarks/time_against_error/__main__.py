"""Bake time against error, ours and the peers' side by side: JSON, tables and plots.

    python -m benchmarks.time_against_error [--quick | --dense | --processes] [--meshes FOLDER] [--peer NAME=PYTHON …]

The full form leaves out meshes of 500,000 vertices and more; --dense measures these about the errors wanted, against
Mitsuba alone; --processes times whole processes from their start to their end. Results go to benchmarks/results/
time_against_error.json (…_dense.json, …_processes.json), tables and plots to build/time_against_error;
with --quick both go there. A peer runs by its own interpreter, the one given or the
one that `make peers` has made; those without are left out. benchmarks/evidence/speed.md says how it is measured.
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
from .methods import DENSE, METHODS, PROCESSES
from .present import present
from .programs import ROOT, open_programs, peer_option
from .results import write_results
from .suite import MANY, Specimen, builtin, from_folder

FORMS = {"full": METHODS, "quick": METHODS, "dense": DENSE, "processes": PROCESSES}
FULL = Plan(rounds=3, reference_rays=16384, reference_vertices=8192, patience=1.0)
QUICK = Plan(rounds=2, reference_rays=8192, reference_vertices=2048, patience=0.2)


def specimens(form: str, folder: Path | None) -> list[Specimen]:
    """The meshes of a form, those of `folder` included."""
    few = form in ("quick", "processes")
    found = builtin(few) + (from_folder(folder, few) if folder else [])
    if form == "processes":
        return [replace(each, dense=True) for each in found]
    return [each for each in found if (each.dense and len(each.make().vertices) >= MANY) == (form == "dense")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    forms = parser.add_mutually_exclusive_group()
    forms.set_defaults(form="full")
    for form, meaning in (
        ("quick", "few meshes, few rays: minutes rather than half an hour"),
        ("dense", "only the densest meshes, ours against Mitsuba's best"),
        ("processes", "few meshes, whole processes, binary falloff"),
    ):
        forms.add_argument(f"--{form}", action="store_const", const=form, dest="form", help=meaning)
    parser.add_argument("--meshes", type=Path, metavar="FOLDER", help="also the mesh files in this folder")
    parser.add_argument("--patience", type=float, default=1.0, help="a factor on the time that methods may take")
    peer_option(parser)
    arguments = parser.parse_args()
    start = time.perf_counter()
    form = arguments.form
    plan = QUICK if form == "quick" else FULL
    plan = replace(plan, patience=plan.patience * arguments.patience)
    named = "" if form in ("full", "quick") else form
    tables_folder = ROOT / "build" / "time_against_error" / named
    results_folder = tables_folder if form == "quick" else ROOT / "benchmarks" / "results"
    for folder in (results_folder, tables_folder):
        folder.mkdir(parents=True, exist_ok=True)
    target = results_folder / f"time_against_error{named and f'_{named}'}.json"
    with open_programs(dict(arguments.peer), form == "processes") as (programs, missing):
        for name, reason in missing.items():
            print(f"{name} is left out: {reason}")
        methods = [method for method in FORMS[form] if method.program in programs]
        results: dict[str, Any] = {
            "form": form,
            "machine": machine(),
            "versions": {name: program.version for name, program in programs.items()},
            "missing": missing,
            "plan": asdict(plan),
            "targets": TARGETS,
            "methods": [asdict(method) for method in methods],
            "meshes": [],
            "runs": [],
        }
        chosen = specimens(form, arguments.meshes)
        warm_up(programs, methods, all(each.dense for each in chosen))
        for specimen in chosen:
            about, runs = measure_mesh(specimen, programs, methods, plan, lambda text: print(text, flush=True))
            results["meshes"].append(about)
            results["runs"] += runs
            results["minutes"] = (time.perf_counter() - start) / 60
            write_results(target, results)
    print(f"\n{present(results, tables_folder)}\n{target}, {tables_folder}: {results['minutes']:.1f} minutes")


if __name__ == "__main__":
    main()
