"""`python -m daemon.cli`: the command without its console script."""

from daemon.cli.main import main

main()
