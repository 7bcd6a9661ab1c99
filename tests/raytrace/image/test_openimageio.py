"""OpenImageIO is imported whole, whatever signals come meanwhile."""

import subprocess
import sys

import pytest
from project import ROOT

INTERRUPTED = "import os, signal\nos.kill(os.getpid(), signal.{name})\nwhole = True\n"
IMPORTED = """
import signal, sys
from obscurance.raytrace.image.formats import openimageio
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.default_int_handler)
sys.path.insert(0, sys.argv[1])
try:
    openimageio()
except KeyboardInterrupt:
    print("interrupted", sys.modules["OpenImageIO"].whole, signal.getsignal(signal.SIGINT).__name__)
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_an_interrupt_waits_until_it_is_imported(tmp_path, name):
    (tmp_path / "OpenImageIO.py").write_text(INTERRUPTED.format(name=name))
    command = [
        sys.executable,
        "-c",
        f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler){IMPORTED}",
    ]
    done = subprocess.run([*command, tmp_path], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.stdout == "interrupted True default_int_handler\n", done.stderr
