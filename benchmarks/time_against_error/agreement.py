"""Check that all programs compute the same quantity: each program's w at many rays against the reference.

    python -m benchmarks.time_against_error.agreement [--samples 4096] [--meshes FOLDER] [--peer NAME=PYTHON …]

Writes build/agreement.md. With estimators of the same quantity the mean difference (the bias) is lost in
its standard error, and the RMSE is what that many rays of the method's kind leave.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from obscurance.scenes.validation.reference import RAYS, Errors

from .methods import METHODS, OURS, Method
from .programs import Program, Task, open_programs, peer_option
from .references import cached_reference
from .suite import Specimen, builtin, falloffs, from_folder
from .tables import markdown

FOLDER = Path(__file__).parent.parent.parent / "build"
VERTICES = 8192
LIMITED_RAYS = {"blender": 256}
HEAD = ["mesh", "falloff", "method", "rays", "bias", "± its standard error", "RMSE", "99th percentile", "largest"]


def compare(
    specimen: Specimen, programs: Mapping[str, Program], methods: Sequence[Method], samples: int
) -> list[list[str]]:
    """A row for every method and falloff."""
    mesh, rows = specimen.make(), []
    with tempfile.TemporaryDirectory() as folder:
        task = Task.of(mesh, Path(folder) / "mesh.npz")
        chosen = falloffs(mesh)
        truth = cached_reference(task, [each.resolve(mesh.radius) for each in chosen.values()], RAYS, VERTICES)
        for row, (name, falloff) in enumerate(chosen.items()):
            for method in methods:
                if name.split()[0] not in method.falloffs:
                    continue
                rays = min(samples, LIMITED_RAYS.get(method.program, samples))
                made = programs[method.program].bake(task, falloff, 7, {"samples": rays, **method.options})
                w = made.w[truth.vertices]
                errors = Errors.of(w, truth.w[row])
                uncertain = float(np.std(w - truth.w[row]) / np.sqrt(len(w)))
                figures = (errors.mean, uncertain, errors.rmse, errors.p99, errors.largest)
                cells = [f"{figures[0]:+.1e}", *(f"{x:.1e}" for x in figures[1:2]), *(f"{x:.4f}" for x in figures[2:])]
                rows.append([specimen.name, name, method.name, str(rays), *cells])
                print(" ".join(rows[-1]), flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=4096)
    parser.add_argument("--meshes", type=Path, metavar="FOLDER", help="the three smallest mesh files in it, as well")
    peer_option(parser)
    arguments = parser.parse_args()
    specimens = builtin(quick=True) + (from_folder(arguments.meshes, quick=True) if arguments.meshes else [])
    with open_programs(dict(arguments.peer)) as (programs, missing):
        methods = [method for method in METHODS if method.program in programs and method.setting == "samples"]
        rows = [row for specimen in specimens for row in compare(specimen, programs, methods, arguments.samples)]
    versions = ", ".join(program.version for name, program in programs.items() if name != OURS)
    notes = [f"{name} is missing: {reason}" for name, reason in missing.items()]
    text = f"# Agreement with the reference\n\n{versions}; reference of {RAYS:,} rays. {' '.join(notes)}".rstrip()
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "agreement.md").write_text(f"{text}\n\n{markdown(HEAD, rows)}\n")


if __name__ == "__main__":
    main()
