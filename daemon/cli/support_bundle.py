"""`handeyed support-bundle CONFIG`: write a support bundle."""

import os
from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.output import Json, print_answer


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
