"""`obscurance validate`: closed forms against bakes."""

from ..jobs.console import compiling


def validate_closed_forms(samples: int, seed: int, threads: int | None) -> bool:
    """Print the table of closed forms; whether all are met. Raises: OptionError."""
    from ao.options import Options

    from ..validation.table import run_validation, validation_table

    Options(samples=samples, seed=seed, threads=threads)
    with compiling():
        results = run_validation(samples=samples, seed=seed, threads=threads)
    print(validation_table(results))
    return all(result.ok for result in results)
