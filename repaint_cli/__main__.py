"""`python -m repaint_cli` is `repaint`."""

from repaint_cli.cli.app import main

main()
