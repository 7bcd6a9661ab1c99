"""Signals while a library's call, one step of the interpreter, goes on for long."""

import os
import signal
import subprocess
import sys
import time

import pytest
from command import ROOT, started

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals")
BUSY = """
from obscurance import interrupts
interrupts.all_imported()
import hashlib
print("begun", flush=True)
hashlib.pbkdf2_hmac("sha256", b"", b"", 50_000_000)
"""


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_a_call_that_takes_no_notice_of_signals_ends_within_a_second(by):
    with started([sys.executable, "-c", BUSY], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert running.stdout.readline() == b"begun\n"
        time.sleep(0.1)
        running.send_signal(by)
        begun = time.monotonic()
        _, errors = running.communicate(timeout=60)
        seconds = time.monotonic() - begun
    assert running.returncode == 128 + by
    assert errors == b"interrupted; no file is half-written\n"
    assert seconds < 3  # .5 on an idle machine; the call takes ten and more
