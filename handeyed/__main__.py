"""`python -m handeyed` is the command `handeyed`."""

from handeyed.command import main

main()
