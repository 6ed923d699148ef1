"""`handeyed health CONFIG`: whether the daemon with these settings answers."""

from pathlib import Path
from typing import Annotated

import typer


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
