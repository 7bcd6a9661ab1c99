"""`obscurance compare`: error metrics of one image against another."""

from pathlib import Path

from raytrace.errors import OptionError
from raytrace.image.compare import compare
from raytrace.image.write import check_image_target

from ..jobs.console import columns
from ..jobs.options import Metric, named

_FIGURES = ("mean_error", "rms_error", "max_error", "psnr", "flip")


def compare_files(a: Path, b: Path, threshold: float | None, metric: Metric, difference: Path | None) -> bool:
    """Print the metrics and write the FLIP map; whether `metric` is within `threshold`, if there is one."""
    if threshold is not None and not threshold >= 0:
        raise OptionError("threshold", "a number in [0, inf)", threshold)
    if difference:
        with named("difference"):
            check_image_target(difference, layers=("beauty",))
    comparison = compare(a, b, difference)
    print(columns([(name, f"{getattr(comparison, name):.6g}") for name in _FIGURES]))
    return threshold is None or comparison.within(threshold, metric)
