"""Commands killed at random moments: every output is whole, and the same bytes when the command runs again."""

import json
import os
import subprocess
import sys

import pytest
from command import started
from killed_commands import KINDS
from project import HELPERS, environment

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


def killed(folder, kills, kind):
    """How often there were kept rows after a kill."""
    command = [sys.executable, HELPERS / "bakes" / "killed_commands.py", str(kills), "1", kind, folder]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with started(command, env=environment(), **pipes) as running:  # it forks: the commands are to end with it
        output, errors = running.communicate(timeout=3600)
    assert running.returncode == 0, errors
    seen = json.loads(output.splitlines()[-1])
    assert seen["killed"] >= kills
    assert seen["faults"] == []
    return seen["kept"]


def test_what_is_killed_is_whole_or_not_there_and_goes_on(tmp_path):
    killed(tmp_path, 2, "batch")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_outputs_of_commands_killed_forty_times(tmp_path, kind):
    assert killed(tmp_path, 40, kind) or kind == "picture"
