"""What every command shares: results on standard output, everything else on standard error, bars on a terminal only."""

import errno
import os
import secrets
import stat
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import CommandError, ExitStatus

if TYPE_CHECKING:
    from pydantic import BaseModel

    from calibration.documents.calibration import CalibrationDocument
    from calibration.problem import Problem
    from calibration.solution import Solution
    from calibration.targets import Target
    from calibration.verdict import Verdict, VerdictLimits
    from daemon.sessions.session_reader import SessionFolder

Commands = tuple[Callable[..., None] | typer.Typer, ...]
"""Of an extension: functions that are commands, and groups of commands, each with a name of its own."""


@dataclass(frozen=True, eq=False)
class SolvedFolders:
    """What `handeyed solve` has in its hands when its `folders` are solved, each alone.

    value : of the option, "" of one without. solved : the sessions among the folders, except those of pairs of points.
    out : folder for further files. at : file of the points that matter.
    """

    value: str
    folders: Sequence[Path]
    solved: "Sequence[tuple[SessionFolder, Problem, Solution]]"
    limits: "VerdictLimits"
    at: Path | None
    out: Path | None
    json: bool


AfterSolve = Callable[[SolvedFolders], bool]
"""Prints and writes what it finds in all folders; returns whether that is accepted. Raises CommandError."""


@dataclass(frozen=True, eq=False)
class CommandExtension:
    """What an extension adds to the command line. after_solve : by the option of `handeyed solve`, such as "--arm"."""

    commands: Commands = ()
    after_solve: Mapping[str, AfterSolve] = field(default_factory=dict)


Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs instead of words for people.")]

REASONS = "ACCES PERM ROFS BUSY XDEV NAMETOOLONG INVAL NOSYS OPNOTSUPP"
IN_PLACE = {getattr(errno, f"E{reason}") for reason in REASONS.split()}
"""Why nothing is renamed onto a file: rights of its folder, another owner, a mount of its own, a long name, a link."""

# What the commands over a scan's clouds share.
ArmErrors = Annotated[Path | None, typer.Option(help="arm.json of solve --arm: the flange is where that arm has it.")]
ArmTemperature = Annotated[float | None, typer.Option(help="With --arm: of its links when the scan was taken, in °C.")]
Refine = Annotated[bool, typer.Option("--refine", help="Fit the views to each other, within the robot's noise.")]


def print_answer(json: bool, answer: Any, words: str) -> None:
    """Print the answer in one line for programs, or the words for people."""
    typer.echo(dumps(answer) if json else words)


def print_error(text: str) -> None:
    """Print lines on standard error; journald takes them for errors: `journalctl -p warning` shows them."""
    from daemon.runtime.logs import print_error_line

    for line in text.splitlines():
        print_error_line(line)


@contextmanager
def writing(place: Path, fix: str = "choose another --out") -> Iterator[None]:
    """Context manager: what cannot be written in it is a CommandError that names `place` and `fix`."""
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise CommandError(str(place), f"cannot be written ({reason})", fix) from None


def write_whole(file: Path, content: bytes) -> None:
    """Write a file that is there when it is whole, with the old one's mode and owner. Raises CommandError.

    A link, a device, one of several names, and one onto which nothing can be renamed are written as they are.
    """
    from daemon.runtime.durable_files import rename_durably

    part = file.parent / f".{file.name}.{secrets.token_hex(4)}.part"
    with writing(file):
        old = file.lstat() if os.path.lexists(file) else None
        try:
            if old and not (stat.S_ISREG(old.st_mode) and old.st_nlink == 1 and os.access(file, os.W_OK)):
                raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
            os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600 if old else 0o666))  # through no link
            part.write_bytes(content)
            if old and hasattr(os, "chown"):
                os.chown(part, old.st_uid, old.st_gid)
            if old:
                part.chmod(stat.S_IMODE(old.st_mode))
            rename_durably(part, file)
        except OSError as error:
            if error.errno not in IN_PLACE:
                raise
            file.write_bytes(content)
        finally:
            with suppress(OSError):
                part.unlink()


def write_document(file: Path, document: "BaseModel") -> None:
    """Write a document as JSON, in a folder that is made when it is missing. Raises CommandError."""
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, f"{document.model_dump_json(indent=1)}\n".encode())


def new_calibration(solution: "Solution", verdict: "Verdict", target: "Target | None" = None) -> "CalibrationDocument":
    """calibration.json of a solution, with a new id and the present time."""
    from calibration.documents.calibration import calibration_document
    from daemon.runtime.clock import Clock, time_ordered_id
    from daemon.runtime.version import SOFTWARE

    clock = Clock()
    dated: dict[str, Any] = {"calibration_id": time_ordered_id(clock), "created_at": clock.timestamp()}
    return calibration_document(solution, verdict, **dated, software=SOFTWARE, target=target)


class CommandGroup(typer.core.TyperGroup):
    """A group of commands that turns the project's errors into a line on standard error and an exit status."""

    def invoke(self, ctx: Any) -> Any:
        from calibration.errors import CalibrationError, DocumentError
        from daemon.errors import DaemonError, PrintRefused
        from drivers.errors import DeviceError
        from handeyed.errors import ClientError, NotAnAddress
        from registration.errors import RegistrationError

        try:
            return super().invoke(ctx)
        except CommandError as error:
            print_error(str(error))
            raise typer.Exit(error.status) from None
        except (DocumentError, NotAnAddress, PrintRefused, RegistrationError) as error:
            print_error(str(error))
            raise typer.Exit(ExitStatus.UNREADABLE) from None
        except (CalibrationError, ClientError, DaemonError, DeviceError) as error:
            print_error(str(error))
            raise typer.Exit(ExitStatus.FAILED) from None
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
            print_error(f"{error.filename or 'standard output'}: no space is left: free some, or write elsewhere")
            raise typer.Exit(ExitStatus.FAILED) from None


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error if it is a terminal; yields a function to call with (done, of)."""
    if not sys.stderr.isatty():
        yield lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
    from rich.table import Column

    # A long path is shortened, not the count.
    name = TextColumn("{task.description}", table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis"))
    columns = (name, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, of: progress.update(task, completed=done, total=of)
