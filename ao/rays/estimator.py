"""Rows of an estimate of w: what a gathering kernel writes for each point."""

from raytrace.kernel.jit import inline

from .directions import BATCHES

W, BATCH_VARIANCE, BENT = range(3)  # columns of rows: w, the variance between batches, the mean of μ·direction
COLUMNS = BENT + 3
VALUES = [W, *range(BENT, COLUMNS)]


@inline
def write_estimate(out, row, lost, bent, table, chosen, frame):
    """Write a row from what a point's rays have lost.

    Args:
        out: float64 (n, COLUMNS). lost: float64 (BATCHES,), sums of 1 − μ over the batches of directions.
        bent: sum of (1 − μ)·direction. table: DirectionTable, of which set `chosen` was turned into `frame`.
    """
    samples, used = len(table.batches), min(BATCHES, len(table.batches))
    mean_loss = lost.sum() / samples
    spread = 0.0
    for k in range(used):
        spread += (lost[k] / table.batch_sizes[k] - mean_loss) ** 2
    out[row, W] = min(max(1.0 - mean_loss, 0.0), 1.0)
    out[row, BATCH_VARIANCE] = spread / (used - 1) if used > 1 else 0.0
    x, y, z = bent
    mean = table.mean
    x, y, z = mean[chosen, 0] - x / samples, mean[chosen, 1] - y / samples, mean[chosen, 2] - z / samples
    for axis in range(3):
        out[row, BENT + axis] = x * frame[0][axis] + y * frame[1][axis] + z * frame[2][axis]
