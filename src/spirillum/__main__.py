"""`python -m spirillum`."""

from spirillum.cli import main

main()
