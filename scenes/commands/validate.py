"""`obscurance validate`: closed forms, stress tests, or tolerances on generated meshes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from raytrace.errors import OptionError

from .console import KERNELS_OF_BAKE, compiling, progress
from .options import VALIDATION_SAMPLES


def check_forms(
    samples: int,
    seed: int | None,
    stress: bool,
    generated: bool,
    long: bool,
    of_generated: dict[str, Collection[object]],
) -> None:
    """Refuse options of one form of the command that were given with another.

    Args: of_generated: the values of options for generated meshes alone, by name.

    Raises: OptionError.
    """
    if long and not (stress or generated):
        raise OptionError("long", "--stress or --generated with it", "neither")
    if stress and (samples, seed, generated) != (VALIDATION_SAMPLES, None, False):
        got = f"{samples}, {seed}, {generated}"
        raise OptionError("--samples, --seed, --generated", "none of them with --stress", got)
    for name, values in of_generated.items():
        if values and not generated:
            raise OptionError(name, "--generated with it", "no --generated")


def validate_closed_forms(samples: int, seed: int, threads: int | None) -> bool:
    """Print the table of closed forms; whether all are met. Raises: OptionError."""
    from ao.options import Options

    from ..validation.table import run_validation, validation_table

    Options(samples=samples, seed=seed, threads=threads)
    with compiling(KERNELS_OF_BAKE):
        results = run_validation(samples=samples, seed=seed, threads=threads)
    print(validation_table(results))
    return all(result.ok for result in results)


def validate_stress(threads: int | None, long: bool) -> bool:
    """Print the table of stress tests; whether all pass. Raises: OptionError."""
    from ao.options import Options

    from ..stress.line import stress_table
    from ..stress.suite import run_stress

    Options(threads=threads)
    with compiling(KERNELS_OF_BAKE), progress(False, "groups") as (advance,):
        lines = run_stress(long, threads, advance)
    print(stress_table(lines))
    return all(line.ok for line in lines)


def validate_generated(
    files: Sequence[Path], samples: int, seed: int | None, threads: int | None, long: bool, wanted: Collection[str]
) -> bool:
    """Print a line for each bake as it ends, then verdicts; whether all keep the tolerance.

    Args:
        files: meshes in place of the built-in ones. samples: rays a vertex of the truth. seed: None for a fresh one.
        long: every family with every falloff and tolerance, a verdict each. wanted: the families; all if empty.

    Raises:
        OptionError: no such family, an option out of range, a missing package. MeshError: a mesh file cannot be read.
    """
    import secrets
    from importlib.util import find_spec

    from ao.options import MAX_SAMPLES, Options
    from raytrace.errors import nearest_name

    from ..generated import suite, verdict
    from ..readers.load import load

    if find_spec("fast_simplification") is None:
        raise OptionError("generated", "the extra package of pip install 'obscurance[generated]'", "none")
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
    chosen = [case for case in cases if not wanted or case.family in wanted]
    outcomes = []
    print(verdict.HEAD)
    with compiling(KERNELS_OF_BAKE):
        for outcome in suite.run_generated(chosen, samples=samples, threads=threads, given=given):
            outcomes.append(outcome)
            print(verdict.outcome_row(outcome), flush=True)
    if long:
        found = verdict.verdicts(outcomes, verdict.LIMITS)
    else:
        found = [verdict.verdict(f"seed {seed}", outcomes, verdict.FEW)]
    print("\n" + verdict.verdict_table(found))
    return all(one.ok for one in found)
