"""`handeyed mock ...`: run the mock cell's program."""

import os
import sys
from typing import Annotated

import typer

from daemon.runtime.module_names import module_name


def mock(
    arguments: Annotated[
        list[str] | None, typer.Argument(help="run (the default), truth, score, faults, and their options.")
    ] = None,
) -> None:
    """Start the mock cell: an ABB controller, a camera and a scanner with known truth, on real sockets.

    `handeyed mock run --help` lists its options; `handeyed mock faults` the faults it can simulate.
    """
    # Replaces this process: the daemon does not import the mock, and signals reach it directly.
    os.execv(sys.executable, [sys.executable, "-P", "-m", module_name("mock_robot"), *(arguments or ["run"])])  # noqa: S606 - our own mock
