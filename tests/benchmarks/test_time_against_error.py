"""The benchmark's arithmetic, its way up the ladders, and its manners when a peer is missing."""

import sys

import numpy as np
import pytest

from benchmarks.peers.process import FOLDER, PeerFailed, Process
from benchmarks.time_against_error.analysis import Point, TimeTo, time_to
from benchmarks.time_against_error.measure import Climb, Plan, climb_all
from benchmarks.time_against_error.methods import OURS, Method
from benchmarks.time_against_error.programs import PEERS, Made, Task, open_programs
from benchmarks.time_against_error.references import well_posed
from benchmarks.time_against_error.suite import falloffs, stone, subdivided
from obscurance import ao
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.polyhedra import hull
from obscurance.scenes.validation.reference import Reference


def run_of(setting, seconds, rmse, mesh="m", falloff="binary", method=OURS):
    """A run as the results hold it: `seconds` and `rmse` are lists over rounds."""
    same = {"build": [0.1] * len(rmse), "p99": rmse, "largest": rmse, "mean": [0.0] * len(rmse)}
    of = {"mesh": mesh, "falloff": falloff, "method": method, "setting": setting}
    return of | {"seconds": seconds, "rmse": rmse} | same


def curve(*pairs):
    return [Point.of(run_of(4**k, [seconds], [rmse])) for k, (seconds, rmse) in enumerate(pairs)]


def test_times_between_points_follow_a_power_law_exactly():
    points = curve(*((t, 0.05 * t**-0.7) for t in (0.5, 2.0, 8.0)))
    found = time_to(points, 0.02)
    assert found.how == "between"
    assert found.seconds == pytest.approx((0.05 / 0.02) ** (1 / 0.7), rel=1e-12)
    assert time_to(points, points[1].rmse).seconds == pytest.approx(2.0)


def test_times_beyond_the_points_keep_their_fixed_part():
    """RMSE ∝ rays^(−1/2) and 5 s + .1 s a ray: 16 times the rays of the last point quarter its error."""
    rays = [Point.of(run_of(n, [5 + 0.1 * n], [0.64 / n**0.5])) for n in (64, 256)]
    assert time_to(rays, 0.01) == TimeTo(pytest.approx(5 + 0.1 * 4096), "beyond")
    tolerance = [Point.of(run_of(e, [1 / e], [e])) for e in (0.08, 0.04)]
    assert time_to(tolerance, 0.01) == TimeTo(pytest.approx(100.0), "beyond")


def test_a_cheapest_bake_that_is_good_enough_is_what_it_takes():
    assert time_to(curve((1, 0.008), (4, 0.004)), 0.01) == TimeTo(1, "below")


@pytest.mark.parametrize("points", [(), ((1, 0.05),), ((1, 0.05), (4, 0.049)), ((1, 0.05), (4, 0.06))])
def test_a_curve_held_up_by_a_bias_is_not_continued(points):
    assert time_to(curve(*points), 0.01) is None


def test_the_last_point_may_be_exact():
    assert time_to(curve((1, 0.05), (4, 0.0)), 0.01) == TimeTo(4, "between")


class Pretender:
    """A program whose RMSE is .08·(16/samples)^½ and whose bakes claim to take 10 ms a sample."""

    version = "pretender 1"

    def __init__(self, asked):
        self.asked = asked

    def bake(self, task, falloff, seed, arguments):
        self.asked.append((id(self), arguments["samples"], seed))
        error = 0.08 * (16 / arguments["samples"]) ** 0.5
        return Made(0.01 * arguments["samples"], 0.001, np.full(4, 0.5 + error))


def climbed(seconds=1e9, rounds=2, patience=1.0, count=2):
    asked = []
    programs = {f"p{k}": Pretender(asked) for k in range(count)}
    methods = [Method(name, name, ladder=(16, 64, 256, 1024, 4096, 16384), seconds=seconds) for name in programs]
    truth = Reference(np.arange(4), np.full((1, 4), 0.5))
    plan = Plan(rounds, 64, 4, patience)
    return climb_all(None, ao.Binary(), truth, methods, programs, plan, lambda text: None), asked


def test_a_ladder_ends_below_the_hardest_target():
    climbs, _ = climbed()
    assert [list(climb.rungs) for climb in climbs] == [[16, 64, 256, 1024, 4096, 16384]] * 2
    last = climbs[0].rungs[16384][0]["rmse"]
    assert last == pytest.approx(0.08 / 32)
    climb = Climb(climbs[0].method, {256: [{"rmse": 0.0039, "seconds": 1.0}]})
    assert not climb.goes_on(1.0)


def test_a_ladder_ends_where_time_runs_out_but_not_before_two_rungs():
    climbs, _ = climbed(seconds=30.0)
    assert list(climbs[0].rungs) == [16, 64, 256, 1024]
    climbs, _ = climbed(seconds=30.0, patience=0.0)
    assert list(climbs[0].rungs) == [16, 64]


def test_missing_peers_are_left_out_with_a_reason(tmp_path, capfd):
    wrong = tmp_path / "python"
    wrong.write_text("#!/bin/sh\nexit 3\n")
    wrong.chmod(0o755)
    given = {name: tmp_path / "none" for name in PEERS} | {"open3d": wrong}
    with open_programs(given) as (programs, missing):
        assert list(programs) == [OURS]
    assert set(missing) == set(PEERS)
    assert "make peers" in missing["mitsuba"]
    assert "ao_open3d.py has ended" in missing["open3d"]


def test_what_a_peer_prints_does_not_disturb_its_answers(tmp_path):
    script = tmp_path / "noisy.py"
    script.write_text(
        f"import sys; sys.path.insert(0, {str(FOLDER)!r})\n"
        "import os\nfrom serve import serve\n"
        "def answer(request):\n"
        "    print('noise'); os.system('echo more noise')\n"
        "    if request['x'] < 0: raise SystemExit(1)\n"
        "    return {'twice': 2 * request['x']}\n"
        "serve({'version': 'noisy 1'}, answer)\n"
    )
    with Process(sys.executable, script) as peer:
        assert peer.about == {"version": "noisy 1"}
        assert [peer.ask(x=x)["twice"] for x in (1, 21)] == [2, 42]
        with pytest.raises(PeerFailed):
            peer.ask(x=-1)


def test_the_numpy_peer_bakes_what_we_bake(tmp_path):
    mesh = stone(3)
    ordinary = ao.bake(mesh, samples=1).flags == 0
    assert ordinary.mean() > 0.99
    task = Task.of(mesh, tmp_path / "mesh.npz")
    with open_programs({name: tmp_path / "none" for name in PEERS if name != "embreex"}) as (programs, _):
        assert set(programs) == {OURS, "embreex"}
        for falloff in falloffs(mesh).values():
            ours, theirs = (programs[name].bake(task, falloff, 0, {"samples": 1024}) for name in (OURS, "embreex"))
            difference = (ours.w - theirs.w)[ordinary]
            assert np.sqrt(np.mean(difference**2)) < 0.005
            assert abs(difference.mean()) < 5e-4
            assert 0 < theirs.build < theirs.seconds


def test_denser_meshes_are_smoothed_by_loops_scheme():
    """An octahedron's corners by hand: 33/64 of what they were, and 3/8 of the two ends of each edge."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    dense = subdivided(Mesh(*hull(corners)), 1)
    sums = (corners[:, None] + corners).reshape(-1, 3)
    edges = np.unique(sums[(sums**2).sum(axis=1) == 2], axis=0)
    assert np.unique(dense.vertices, axis=0) == pytest.approx(np.unique([*corners * 33 / 64, *edges * 3 / 8], axis=0))
    assert len(dense.faces) == 4 * 8


def test_vertices_whose_w_hangs_on_their_exact_place_are_not_used():
    """A floor that runs into a closed room: moved far enough, the vertices in the room's wall are inside or outside."""
    floor = [[-1, -1, 0], [0, -1, 0], [1, -1, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 0], [0, 0, 0]]
    room = [[x, y, z] for x in (0, 3) for y in (-2, 2) for z in (-1, 2)]
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[0, 1, 6], [1, 2, 6], [2, 5, 6], [5, 4, 6], [4, 3, 6], [3, 0, 6]]
    for a, b, c, d in sides:
        faces += [[a + 7, b + 7, c + 7], [a + 7, c + 7, d + 7]]
    mesh = Mesh(np.array(floor + room, float), faces)
    mus = [ao.Binary().resolve(mesh.radius)]
    assert well_posed(mesh, np.arange(7), mus, distance=1e-2).tolist() == [True, False, True, True, False, True, False]
