"""Runs damaged inputs through processes of their own: a crash, a hang or a lack of memory ends only such a process.

python tests/helpers/fuzz/fuzzing.py [COUNT [SEED]]   COUNT inputs (60,000), then a table; status 1 after any finding
python tests/helpers/fuzz/fuzzing.py 15000 commands  the same through every command that reads them (`fuzz_worker`)
"""

import json
import signal
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor

from project import HELPERS, environment

WORKER = HELPERS / "fuzz" / "fuzz_worker.py"
COUNT = 60_000
BATCH = 2000
SILENCE = 600  # seconds of wall time without a result: asleep


def run(count=COUNT, seed="0", processes=2, batch=None, worker=WORKER):
    """Give `count` inputs to the loaders.

    Returns:
        findings: each a dict of index, family, finding.
        counts: family to how many were accepted, refused, findings.
        most: family to the largest memory in bytes and processor time in seconds.
    """
    batch = batch or (BATCH if not seed.startswith("commands") else BATCH // 10)
    spans = [(first, min(first + batch, count)) for first in range(0, count, batch)]
    findings, counts, most, lock = [], {}, {}, threading.Lock()

    def work(span):
        first, end = span
        while first < end:
            records, reached = _process(worker, seed, first, end)
            with lock:
                for record in records:
                    if isinstance(record, dict):
                        findings.append(record)
                        print(json.dumps(record), file=sys.stderr, flush=True)
                        record = [record["family"], "finding", 0, 0.0]
                    family, outcome, peak, seconds = record
                    counts.setdefault(family, dict.fromkeys(("accepted", "refused", "finding"), 0))[outcome] += 1
                    before = most.get(family, (0, 0))
                    most[family] = (max(peak, before[0]), max(seconds, before[1]))
            first = reached + 1

    with ThreadPoolExecutor(processes) as pool:
        list(pool.map(work, spans))
    return sorted(findings, key=lambda each: each["index"]), counts, most


def _process(worker, seed, first, end):
    """The records of one process, and the last index that it came to."""
    with tempfile.NamedTemporaryFile() as progress:
        command = [sys.executable, str(worker), seed, str(first), str(end), progress.name]
        with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
            try:
                status = subprocess.run(
                    command,
                    stdout=output,
                    stderr=errors,
                    timeout=SILENCE + (5 if seed.startswith("commands") else 0.2) * (end - first),
                    check=False,
                    env=environment(),
                ).returncode
            except subprocess.TimeoutExpired:
                status = "asleep"
            output.seek(0)
            errors.seek(0)
            records = [json.loads(line) for line in output if line.endswith("\n")]
            complaint = errors.read()[-2000:]
        reached = int(progress.read() or first)
    if status == 0:
        return records, end - 1
    reason = f"signal {signal.Signals(-status).name}" if isinstance(status, int) and status < 0 else f"status {status}"
    records.append({"index": reached, "family": "?", "finding": f"the process ended: {reason}; {complaint}"})
    return records, reached


def table(counts, most):
    """Rows for people."""
    rows = [f"{'family':<10} {'inputs':>8} {'accepted':>9} {'refused':>8} {'findings':>9} {'MiB':>6} {'seconds':>8}"]
    for family, each in counts.items():
        peak, seconds = most.get(family, (0, 0))
        inputs = sum(each.values())
        rows.append(
            f"{family:<10} {inputs:>8,} {each['accepted']:>9,} {each['refused']:>8,} {each['finding']:>9,}"
            f" {peak / 2**20:>6.1f} {seconds:>8.2f}"
        )
    return "\n".join([*rows, f"{sum(sum(each.values()) for each in counts.values()):,} inputs"])


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    seed = sys.argv[2] if len(sys.argv) > 2 else "0"
    findings, counts, most = run(count, seed)
    for each in findings:
        print(f"python tests/helpers/fuzz/fuzz_worker.py {seed} {each['index']}  # {each['family']}: {each['finding']}")
    print(table(counts, most))
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
