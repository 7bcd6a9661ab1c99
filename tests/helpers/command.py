"""The `obscurance` command for the tests of the command line: within this process, or as one of its own."""

import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from contextlib import contextmanager, suppress

from project import ROOT

from obscurance import cli

COMMAND = [sys.executable, str(ROOT / "cli.py")]


def obscurance(*arguments):
    """Run the command to its end in this process, at a tenth of the cost of a new one.

    Returns: as `process` does; also what libraries print past Python is caught.
    """
    line = [*COMMAND[1:], *map(str, arguments)]
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        before = sys.argv
        sys.argv = line
        try:
            with _redirected("stdout", 1, output), _redirected("stderr", 2, errors):
                status = _status()
        finally:
            sys.argv = before
        output.seek(0)
        errors.seek(0)
        return subprocess.CompletedProcess(line, status, output.read(), errors.read())


def succeeded(*arguments):
    """`obscurance`, which must succeed: what it prints otherwise is the failure."""
    done = obscurance(*arguments)
    assert done.returncode == 0, done.stderr
    return done


def process(*arguments, **options):
    """Run the command to its end as a process, with the environment, the folder or the random hashes that it has."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=300, **options
    )


@contextmanager
def started(command, **options):
    """A process that goes on beside the test, with what it starts killed when the test leaves it.

    `Popen.send_signal(signal.SIGINT)` reaches it also where the shell starts the tests with interrupts ignored, which
    processes inherit: as `make test &` in a script does.
    """
    posix = os.name == "posix"
    heeded = signal.signal(signal.SIGINT, signal.default_int_handler)  # what is ignored here is so in the process
    try:
        running = subprocess.Popen([str(word) for word in command], start_new_session=posix, **options)
    finally:
        signal.signal(signal.SIGINT, heeded)
    with running:
        try:
            yield running
        finally:
            if posix:
                with suppress(ProcessLookupError, PermissionError):  # it has ended, with all it started
                    os.killpg(running.pid, signal.SIGKILL)
            else:
                running.kill()


BEGUN = """
import {module} as module
run_blocks = module.run_blocks
def run(*arguments):
    print("begun", flush=True)
    run_blocks(*arguments)
module.run_blocks = run
from obscurance import cli
cli.main()
"""


def interrupted_command(module, *arguments):
    """Run the command as a process and interrupt it a tenth of a second after `module` has begun to trace.

    Returns: the status and what it wrote to standard error.
    """
    command = [sys.executable, "-c", BEGUN.format(module=module), *arguments]
    with started(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout.readline() == "begun\n"
        time.sleep(0.1)
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=120)
    return running.returncode, errors


def _status():
    try:
        return cli._run()  # `main` also changes what signals do
    except SystemExit as end:
        return end.code or 0
    except Exception:
        traceback.print_exc()
        return 1


@contextmanager
def _redirected(name, descriptor, file):
    """Send a standard stream of Python and of the system to a file."""
    stream, kept = getattr(sys, name), os.dup(descriptor)
    stream.flush()
    os.dup2(file.fileno(), descriptor)
    setattr(sys, name, file)
    try:
        yield
    finally:
        file.flush()
        setattr(sys, name, stream)
        os.dup2(kept, descriptor)
        os.close(kept)


def refused(result, *words, status=2):
    """One line on standard error that holds `words`, nothing on standard output."""
    assert result.returncode == status, result.stderr
    assert result.stdout == ""
    errors = result.stderr
    assert errors.count("\n") == 1, errors
    for word in words:
        assert word in errors
    assert "Traceback" not in errors


def refused_without_a_trace(folder, words, *arguments):
    """`refused`, and no file of the folder is changed, added or removed."""
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    refused(obscurance(*arguments), *words)
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before
