"""`handeyed check`, `devices`, `health` and `support-bundle`: how the cell is. Nothing moves."""

import os
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


def devices(json: Json = False) -> None:
    """List cameras that answer: address for \\[camera], vendor, model, serial number, and what they can.

    Looks for Basler, GenTL, GigE Vision, USB3 Vision and video devices. Free cameras are opened for a moment.
    """
    from daemon.tools.camera_discovery import discover

    found = discover()
    print_answer(json, [vars(entry) for entry in found], "\n".join(entry.line() for entry in found))


def health(
    config: Annotated[Path, typer.Argument(help="Settings, as in deploy/handeyed.example.toml.")],
    limit: Annotated[float, typer.Option(help="Seconds to wait for the answer.", min=0.1, max=60)] = 4.0,
) -> None:
    """Ask the daemon with these settings whether it lives: at its port, over TLS where they say so. Needs no key.

    Exit status: 0 it answers, 1 it does not, 2 the settings cannot be read.
    """
    from daemon.cli.rest_client import client_of
    from daemon.config.settings import load_settings

    with client_of(load_settings(config), limit) as daemon:
        answer = daemon.get("/health")
        typer.echo(f"{answer['software']} answers at {daemon.url}, for {answer['uptime_s']:.0f} s")


def support_bundle(
    config: Annotated[Path, typer.Argument(help="Settings, as in deploy/handeyed.example.toml.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The .tar.gz; named by the time when left out.")
    ] = None,
    log: Annotated[
        Path | None, typer.Option(help="A log file to include, when journald does not keep the log.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Gather settings, log, versions, the store's summary and the last runs, without secrets. Nothing moves."""
    from datetime import UTC, datetime

    from daemon.cli.rest_client import running_service
    from daemon.tools.support_bundle.bundle import gather

    at = datetime.now(UTC)
    target = out or Path(f"handeyed-support-{at:%Y%m%d-%H%M%S}.tar.gz")
    key, service = os.environ.get("HANDEYED_KEY"), running_service()
    bundle = gather(config, log, f"Bearer {key}" if key else None if service is None else service.authorization)
    size = bundle.write(target, at)
    packed = {"file": str(target), "bytes": size, "contents": ["README.txt", *bundle.files]}
    words = f"{target}: {size / 1e3:.0f} kB, {1 + len(bundle.files)} files; look at it before you send it"
    print_answer(as_json, packed, words)
