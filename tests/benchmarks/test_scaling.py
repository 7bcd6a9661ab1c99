"""The model of more cores: blocks are counted, and what was replaced to count them is put back."""

import pytest

from benchmarks.speed.scaling import Stage, record
from obscurance import ao
from obscurance.ao.execute import work
from obscurance.raytrace.system import threads
from obscurance.scenes.geometry.polyhedra import icosphere


def test_a_stage_waits_for_its_longest_block_and_pays_for_each_join():
    stage = Stage(outside=1.0, joins=[(100, [3.0, 1.0, 1.0, 1.0]), (100, [0.5]), (1, [0.5, 0.5])])
    costs = {2: 0.25, 4: 0.5, 100: 9.0}
    assert stage.predicted(1, costs) == 8.5
    assert stage.predicted(2, costs) == 1.0 + 3.0 + 0.5 + 1.0 + 0.25
    assert stage.predicted(100, costs) == 1.0 + 3.0 + 0.5 + 1.0 + 0.5  # it has blocks for four threads


def test_a_bake_is_recorded_stage_by_stage():
    mesh, run_blocks = icosphere(3), threads.run_blocks
    baked = []
    stages = record(lambda count: baked.append(ao.bake(mesh, samples=8, threads=count)), 4)
    assert {"welding, normals", "hierarchy", "origins", "rays", "denoising", "result"} <= set(stages)
    assert len(stages["rays"].joins) >= 4  # twice, as some vertices are, and those between vertices
    assert all(stage.outside > 0 for stage in stages.values())
    assert all(stage.predicted(2, {1: 0.0, 2: 0.0}) <= stage.predicted(1, {1: 0.0}) for stage in stages.values())
    assert (baked[0].w == ao.bake(mesh, samples=8).w).all()
    assert work.run_blocks is threads.run_blocks is run_blocks


def test_a_failure_while_recording_leaves_nothing_replaced():
    run_blocks = threads.run_blocks
    with pytest.raises(ZeroDivisionError):
        record(lambda count: count // 0, 4)
    assert threads.run_blocks is run_blocks
