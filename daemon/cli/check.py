"""`handeyed check CONFIG`: check the settings and every device."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.errors import ExitStatus
from daemon.cli.output import Json, print_answer
from daemon.model.check_result import CheckResult


def check(
    config: Annotated[Path, typer.Argument(help="Settings, as in deploy/handeyed.example.toml.")],
    config_only: Annotated[bool, typer.Option("--config-only", help="Do not ask the devices.")] = False,
    json: Json = False,
) -> None:
    """Check the settings, every device, interlocks and the PLC's port, one line each, with what to do. Nothing moves.

    Exit status: 0 everything is well, 1 something is not, 2 the settings cannot be read.
    """
    import asyncio

    from daemon.cli.checks import check_devices, check_storage
    from daemon.config.settings import load_settings_file

    settings, loaded = load_settings_file(config)
    results = [CheckResult("settings", True, f"{config} is complete and consistent")]
    if len(files := set(loaded.given_by.values())) > 1:
        for file in sorted(files, key=lambda each: each != str(config)):
            names = ", ".join(name for name, by in loaded.given_by.items() if by == file)
            results.append(CheckResult("settings", True, f"{file} gives {names}"))
    if not config_only:
        results += [check_storage(settings), *asyncio.run(check_devices(settings, loaded))]
    print_answer(json, [vars(result) for result in results], "\n".join(result.line() for result in results))
    raise typer.Exit(ExitStatus.OK if all(result.ok for result in results) else ExitStatus.FAILED)
