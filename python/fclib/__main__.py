"""``python -m fclib`` is the command line."""

from fclib.cli import main

main()
