"""`python -m obscurance`, which imports nothing from the current folder, unless that is the source tree."""

import os
import sys

if not sys.flags.safe_path and sys.path[0] == os.getcwd() != os.path.dirname(os.path.dirname(__file__)):
    del sys.path[0]

from obscurance.cli import main

main()
