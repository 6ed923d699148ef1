"""The command line: one module a command, assembled in `main`. Heavy rooms are imported inside the commands."""
