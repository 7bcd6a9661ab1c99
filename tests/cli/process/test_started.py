"""Processes beside a test: they heed an interrupt whatever the shell ignores, and end with the test."""

import os
import signal
import subprocess
import sys
import time

import pytest
from command import started

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals")
PATIENT = "print('ready', flush=True); import time; time.sleep(60)"
PARENT = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {PATIENT!r}], close_fds=False)"


@pytest.fixture
def ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ignored")
def test_an_interrupt_arrives_where_the_shell_ignores_interrupts():
    with started([sys.executable, "-c", PATIENT], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        running.stdout.readline()
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=30)
    assert b"KeyboardInterrupt" in errors


def test_what_a_process_starts_ends_with_it():
    reader, writer = os.pipe()
    with started([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, pass_fds=[writer]) as running:
        os.close(writer)
        running.stdout.readline()  # the child of the child is at work, with the same pipe
    os.set_blocking(reader, False)
    latest = time.monotonic() + 30
    while True:
        try:
            assert os.read(reader, 1) == b""  # every writer has ended
            break
        except BlockingIOError:
            assert time.monotonic() < latest
            time.sleep(0.01)
    os.close(reader)
    assert running.returncode == -signal.SIGKILL
