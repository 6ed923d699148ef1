"""`python -m daemon.cli`: `handeyed` without the console script."""

from daemon.cli.main import main

main()
