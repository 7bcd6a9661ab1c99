"""Bakes by real workers of a real scheduler: the bits of one process, whoever is lost on the way."""

import time

import numpy as np
import pytest
from clusters import (
    BAKES,
    BLOCKS,
    LEFT_SOCKETS,
    MEDIUM,
    bake_on,
    compiled_by,
    impatient,
    killed_in_mid_block,
    workers_at,
)
from interrupted_bakes import bits

from obscurance.ao.cluster.workers import local_workers
from obscurance.raytrace import InputError, OptionError

__all__ = ["impatient"]
pytestmark = LEFT_SOCKETS


@pytest.mark.parametrize("name", [name for name in BAKES if name not in ("binary", "limited")])
def test_workers_make_the_bits_of_one_process(cluster, tmp_path, name):
    alone = BAKES[name]()  # at first: workers load its kernels
    baked, blocks = bake_on(cluster.scheduler_address, BAKES[name], tmp_path / "w.npy")
    assert bits(baked) == bits(alone)
    assert baked.rays == alone.rays
    assert blocks > 1
    assert not list(tmp_path.iterdir())
    assert set(compiled_by(cluster)) == {()}


@pytest.mark.parametrize("victims", [1, 2])
def test_killed_workers_lose_only_the_blocks_that_they_had(cluster, tmp_path, medium, victims):
    """All that there are may be lost: others come."""
    with killed_in_mid_block(cluster, tmp_path, victims):
        baked, blocks = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy")
    assert bits(baked) == medium
    assert BLOCKS <= blocks <= BLOCKS + 10


@pytest.mark.usefixtures("impatient")
def test_an_address_without_a_scheduler_is_refused(tmp_path):
    with pytest.raises(OptionError, match=r"cluster: expected .* got nothing that answers"):
        bake_on("tcp://127.0.0.1:1", MEDIUM, tmp_path / "w.npy")
    for address in ("local:0", "local:x", "local:", "here", "tcp://", "", "local:5000"):
        with pytest.raises(OptionError, match="cluster: expected local, local:N or the address"):
            local_workers(address)
    assert [local_workers(address) for address in ("local", "local:3", "tcp://a:1")] == [1, 3, None]


def numbered(first, fails=-1):
    """Work of eight rows: numbers from `first` on, in some time; row `fails` of the whole cannot be made."""

    class Numbered:
        rays, block_rays = float(1 << 20), 1

        def __init__(self, numbers):
            self.numbers = numbers

        def __len__(self):
            return len(self.numbers)

        def __getitem__(self, rows):
            return Numbered(self.numbers[rows])

        def tables(self):
            return (np.empty(len(self)),)

        def writer(self, scene, tables):
            def write(start, stop):
                time.sleep(0.05)
                if first + fails in self.numbers[start:stop]:
                    raise InputError("mesh", "row", "one that can be made", fails)
                tables[0][start:stop] = self.numbers[start:stop]

            return write

    return Numbered(np.arange(first, first + 8))


def test_blocks_of_a_work_that_has_failed_are_no_blocks_of_the_next(cluster):
    scene, rows, spans = np.zeros(1), np.zeros(8), [(row, row + 1) for row in range(8)]
    with workers_at(cluster.scheduler_address) as workers:
        with pytest.raises(InputError, match="mesh: row: expected one that can be made, got 1"):
            list(workers.made(numbered(0, fails=1), scene, spans))
        for (first, last), (found,) in workers.made(numbered(100), scene, spans):
            rows[first:last] = found
        assert list(workers.made(numbered(0), scene, [])) == []
    assert rows.tolist() == list(range(100, 108))
