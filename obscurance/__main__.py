"""`python -m obscurance`."""

from obscurance.cli import main

main()
