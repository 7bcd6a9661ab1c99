"""`obscurance validate --generated`: draw, bake, judge, tell."""

from __future__ import annotations

import secrets
from collections.abc import Collection, Sequence
from pathlib import Path

from ao.options import MAX_SAMPLES, Options
from raytrace.errors import OptionError, nearest_name

from ..readers.load import load
from . import suite, verdict


def validate_generated(
    files: Sequence[Path], samples: int, seed: int | None, threads: int | None, long: bool, wanted: Collection[str]
) -> bool:
    """Print a line for each run as it comes, then verdicts; whether all is well.

    Args:
        files: meshes in place of those at hand. samples: rays a vertex of the truth. seed: None for a fresh one.
        long: every family with every falloff and tolerance, a verdict each. wanted: the families; all if empty.

    Raises:
        OptionError: no such family, or an option out of range. MeshError: a mesh file cannot be read.
    """
    if not 2 <= samples <= 2 * MAX_SAMPLES:
        raise OptionError("samples", f"a whole number from 2 to {2 * MAX_SAMPLES}", samples)
    Options(seed=seed or 0, threads=threads)
    given = [load(path).mesh for path in files]
    seed = secrets.randbelow(1 << 31) if seed is None else seed
    cases = suite.long_cases(seed, given) if long else suite.short_cases(seed, given)
    known = dict.fromkeys(case.family for case in cases)
    for name in wanted:
        if name not in known:
            raise OptionError("family", "one of " + ", ".join(known), name, nearest=nearest_name(name, known))
    outcomes = []
    print(verdict.HEAD)
    chosen = [case for case in cases if not wanted or case.family in wanted]
    for outcome in suite.run(chosen, samples=samples, threads=threads, given=given):
        outcomes.append(outcome)
        print(verdict.row(outcome), flush=True)
    if long:
        found = verdict.verdicts(outcomes, verdict.LIMITS)
    else:
        found = [verdict.verdict(f"seed {seed}", outcomes, verdict.FEW)]
    print("\n" + verdict.table(found))
    return all(one.ok for one in found)
