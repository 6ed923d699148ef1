"""The command run in this process, as the shell would see it."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import typer
import typer.testing
from typer.main import get_command
from typer.testing import CliRunner

from daemon.cli.main import app

# Otherwise each call would make all 50 commands anew, as a process does once.
typer.testing._get_command = cache(get_command)


@dataclass(frozen=True)
class Ran:
    """What a command left behind."""

    status: int
    out: str
    err: str

    @property
    def errors(self) -> list[str]:
        return self.err.splitlines()


def handeyed(*arguments: str | Path, command_line: typer.Typer = app) -> Ran:
    """Run `handeyed ARGUMENTS`; an exception that no user should see is raised here."""
    result = CliRunner().invoke(command_line, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Ran(result.exit_code, result.stdout, result.stderr)
