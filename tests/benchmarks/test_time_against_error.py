"""The benchmark's arithmetic, its way up the ladders, and its manners when a peer is missing."""

import json
import sys

import numpy as np
import pytest
import trimesh

from benchmarks.peers.process import FOLDER, PeerFailed, Process
from benchmarks.time_against_error.analysis import Point, TimeTo, best, curves, geometric_mean, speed_up, time_to
from benchmarks.time_against_error.measure import Climb, Plan, climb_all
from benchmarks.time_against_error.methods import METHODS, OURS, Method
from benchmarks.time_against_error.programs import PEERS, Made, Task, open_programs
from benchmarks.time_against_error.references import well_posed
from benchmarks.time_against_error.results import write_results
from benchmarks.time_against_error.suite import falloffs, from_folder, stone, subdivided
from benchmarks.time_against_error.tables import tables
from obscurance import ao
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.polyhedra import hull
from obscurance.scenes.validation.reference import Errors, Reference


def run_of(setting, seconds, rmse, mesh="m", falloff="binary", method=OURS):
    """A run as the results hold it: `seconds` and `rmse` are lists over rounds."""
    same = {"build": [0.1] * len(rmse), "p99": rmse, "largest": rmse, "mean": [0.0] * len(rmse)}
    of = {"mesh": mesh, "falloff": falloff, "method": method, "setting": setting}
    return of | {"seconds": seconds, "rmse": rmse} | same


def curve(*pairs):
    return [Point.of(run_of(4**k, [seconds], [rmse])) for k, (seconds, rmse) in enumerate(pairs)]


def test_a_point_holds_medians_and_the_range_of_its_rounds():
    point = Point.of(run_of(64, [3.0, 1.0, 10.0], [0.02, 0.04, 0.03]))
    assert (point.seconds, point.fastest, point.slowest, point.rmse) == (3.0, 1.0, 10.0, 0.03)


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


def test_a_ladder_may_climb_down_in_its_setting():
    assert time_to([Point.of(run_of(e, [t], [e])) for e, t in ((0.04, 1.0), (0.004, 10.0))], 0.01).seconds == (
        pytest.approx(10**0.602, rel=1e-3)
    )


@pytest.mark.parametrize("points", [(), ((1, 0.05),), ((1, 0.05), (4, 0.049)), ((1, 0.05), (4, 0.06))])
def test_a_curve_held_up_by_a_bias_is_not_continued(points):
    assert time_to(curve(*points), 0.01) is None


def test_the_last_point_may_be_exact():
    assert time_to(curve((1, 0.05), (4, 0.0)), 0.01) == TimeTo(4, "between")


def test_means_are_geometric_and_over_what_is_known():
    assert geometric_mean([2.0, None, 8.0]) == pytest.approx(4.0)
    assert geometric_mean([None]) is None
    assert speed_up(TimeTo(2, "between"), TimeTo(6, "beyond")) == 3
    assert speed_up(None, TimeTo(6, "beyond")) is None
    assert best([None, TimeTo(3, "below"), TimeTo(2, "beyond")]).seconds == 2
    assert best([None]) is None


def test_errors_are_those_of_the_difference():
    errors = Errors.of(np.array([0.5, 0.6, 0.9]), np.array([0.5, 0.5, 1.0]))
    assert (errors.mean, errors.largest) == pytest.approx((0.0, 0.1))
    assert errors.rmse == pytest.approx(np.sqrt(0.02 / 3))


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


def test_methods_take_turns_with_a_new_seed_each_round():
    _, asked = climbed()
    first = [(who, seed) for who, samples, seed in asked if samples == 16]
    a, b = first[0][0], first[1][0]
    assert a != b
    assert first == [(a, 0), (b, 0), (a, 1), (b, 1)]


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


def test_long_bakes_are_not_repeated():
    climbs, _ = climbed(rounds=5)
    assert {setting: len(rounds) for setting, rounds in climbs[0].rungs.items()} == {
        16: 5, 64: 4, 256: 1, 1024: 1, 4096: 1, 16384: 1,
    }  # fmt: skip


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


def test_denser_meshes_with_three_faces_at_an_edge_stay_flat():
    """Three triangles about the z axis: Loop's scheme has no rule for their common edge."""
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    dense = subdivided(Mesh(vertices, faces), 2)
    assert len(dense.faces) == 16 * 3
    assert trimesh.Trimesh(dense.vertices, dense.faces).area == pytest.approx(0.5 + 2**0.5)


def test_a_folder_gives_its_meshes_and_the_largest_one_subdivided(tmp_path):
    for name, count in (("small", 1), ("large", 2)):
        text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" * count + "".join(
            f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}\n" for k in range(count)
        )
        (tmp_path / f"{name}.obj").write_text(text)
    (tmp_path / "notes.txt").write_text("no mesh")
    found = from_folder(tmp_path, quick=False)
    assert [s.name for s in found] == ["small", "large", "large ×4", "large ×16"]
    assert [len(s.make().faces) for s in found] == [1, 2, 8, 32]
    assert [s.name for s in from_folder(tmp_path, quick=True)] == ["small", "large"]


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


def test_tables_show_speed_ups_at_equal_error_and_what_is_missing(tmp_path):
    methods = [METHODS[0], *(method for method in METHODS if method.program == "mitsuba")]
    runs = []
    for mesh in ("a", "a ×4"):
        for falloff, factor in (("binary", 1.0), ("binary 5%", 0.5)):
            for number, method in enumerate(methods):
                slow = factor * (1 + number) * (3 if mesh != "a" else 1)
                runs += [run_of(s, [slow * s / 64], [0.16 / s**0.5], mesh, falloff, method.name) for s in (64, 4096)]
    meshes = [
        {"name": name, "surface": "a", "vertices": count, "faces": 2 * count, "points": count}
        for name, count in (("a", 1000), ("a ×4", 4000))
    ]
    results = {
        "form": "quick", "machine": {"cpu": "abacus", "threads": 2, "load": 0.0, "system": "none"},
        "versions": {"obscurance": "obscurance 1"}, "missing": {"blender": "no interpreter"},
        "plan": {"rounds": 1, "reference_rays": 64, "reference_vertices": 8},
        "methods": [{"name": method.name, "program": method.program} for method in methods],
        "minutes": 1.0, "meshes": meshes, "runs": runs,
    }  # fmt: skip
    text = tables(results, curves(runs))
    assert "| 0.01 | all | 2.00 (4) | 2.00 (4) | 3.00 (4) | 4.00 (4) |" in text
    assert "| 0.01 | a | binary | 0.01 | " not in text
    assert "| a | binary | 0.01 | 4 | 8 | 12 | 16 | 2.00 |" in text
    assert "| 0.01 | a: binary 5% / unlimited, times as fast | 2.00 |" in text
    assert "| 0.01 | a ×4, binary: times the cost of a | 3.00 |" in text
    assert "blender is missing" in text
    write_results(tmp_path / "r.json", results)
    assert json.loads((tmp_path / "r.json").read_text()) == results
