"""Bakes of other programs by `obscurance check`: it finds how they were made, and errs by what they err."""

import json

import numpy as np
import pytest
from command import succeeded
from mesh_files import obj
from meshes import hills

from benchmarks.peers.process import PeerFailed
from benchmarks.time_against_error.programs import Task, open_programs
from obscurance import ao
from obscurance.raytrace.mesh.mesh import Mesh

OPTIONS = {"mitsuba": {"sampler": "multijitter"}}
REACH = "40%"


@pytest.mark.slow
def test_w_of_peers_is_recognised(tmp_path):
    mesh = Mesh(*hills(48))
    (tmp_path / "hills.obj").write_bytes(obj(mesh.vertices, mesh.faces))
    task = Task.of(mesh, tmp_path / "mesh.npz")
    falloffs = ao.Binary(REACH), ao.Binary()
    exact = ao.bake(mesh, falloffs, 1 << 14, denoise=False).values
    checked = set()
    with open_programs({}) as (programs, _):
        for name, program in programs.items():
            for falloff, true in zip(falloffs, exact.T, strict=True):
                try:
                    made = program.bake(task, falloff, 1, {"samples": 256} | OPTIONS.get(name, {}))
                except PeerFailed:  # it starts, but does not trace here
                    break
                np.save(tmp_path / "w.npy", np.nan_to_num(made.w, nan=1.0))
                done = succeeded("check", tmp_path / "w.npy", "--of", tmp_path / "hills.obj", "--json")
                (facts,) = json.loads(done.stdout)
                form, _, length = facts["falloff"].partition(", max distance ")
                assert form == "binary", (name, facts)
                if falloff is falloffs[0]:
                    assert float(length.rstrip("%")) == pytest.approx(40, rel=0.06), name
                error = np.sqrt(np.nanmean((made.w - true) ** 2))
                assert facts["rmse"] == pytest.approx(error, abs=4 * facts["rmse_standard_error"] + 0.001), name
                checked.add(name)
    assert {"obscurance", "embreex"} <= checked
