"""`handeyed opcua FILE`: the gateway, until it is stopped."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.errors import CommandError, ExitStatus


def opcua(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="gateway.toml: the cells, and where clients connect.")],
) -> None:
    """Show the cells of FILE over OPC UA, modelled on OPC 40100-1, until Ctrl-C or SIGTERM.

    It is a client of the daemons' REST interface, and runs beside one of them or anywhere in the plant.

    Exit status: 0 stopped, 2 FILE or a file that it names is unusable.
    """
    import asyncio
    import logging
    import signal

    from gateways.opcua.settings import GatewayError, read_settings

    try:
        from gateways.opcua.gateway import serve
    except ImportError as error:
        fix = "pip install 'handeyed[opcua]'"
        raise CommandError(
            "handeyed opcua", f"a library is missing ({error.name})", fix, ExitStatus.UNREADABLE
        ) from None

    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    for name, level in (("asyncua", logging.CRITICAL), ("asyncuagds", logging.CRITICAL), ("httpx", logging.WARNING)):
        logging.getLogger(name).setLevel(level)  # asyncua logs each fault of a client with a traceback

    async def until_stopped() -> None:
        stopped = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, stopped.set)
        settings = read_settings(file)
        async with serve(settings, alone=True) as endpoint:
            typer.echo(f"{len(settings.cell)} cells at {endpoint}; clients' certificates: {settings.server.trusted}")
            await stopped.wait()

    try:
        asyncio.run(until_stopped())
    except GatewayError as error:
        raise CommandError(error.place, error.what, error.fix, ExitStatus.UNREADABLE) from None
