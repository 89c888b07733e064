"""`python -m goshawk` is `goshawk`."""

from goshawk.cli import main

main()
