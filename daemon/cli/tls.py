"""`handeyed tls init`: make a self-issued certificate."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.output import CommandGroup

app = typer.Typer(
    cls=CommandGroup, name="tls", no_args_is_help=True, help="A certificate for listening on other addresses."
)


@app.callback()
def tls() -> None:
    """A certificate for listening on other addresses than 127.0.0.1."""


@app.command()
def init(
    host: Annotated[
        list[str] | None,
        typer.Option(help="Name or address that clients will use; may be repeated. This machine's by default."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the three files.")] = Path("tls"),
    days: Annotated[int, typer.Option(help="Days of validity.", min=1, max=36_500)] = 3650,
) -> None:
    """Make certificate.pem and private_key.pem for the daemon, and authority.pem for its clients."""
    import json
    import socket
    from datetime import UTC, datetime

    from daemon.access.certificates import AUTHORITY, CERTIFICATE, PRIVATE_KEY, THIS_MACHINE, make_certificate
    from drivers.transports.late_address import is_address

    hosts = list(dict.fromkeys(host or [socket.gethostname(), socket.getfqdn()]))
    make_certificate(out, hosts, datetime.now(UTC), days)
    names = dict.fromkeys((*hosts, *THIS_MACHINE))
    typer.echo(f"for {', '.join(names)}; in the settings:\n")
    typer.echo(f'[server]\nhost = "0.0.0.0"\ncertificate = "{out.resolve() / CERTIFICATE}"')
    typer.echo(f'private_key = "{out.resolve() / PRIVATE_KEY}"')
    if names_given := [name for name in host or () if not is_address(name)]:
        typer.echo(f"allowed_hosts = {json.dumps(names_given)}")
    typer.echo()
    typer.echo(f"clients trust {out.resolve() / AUTHORITY}: curl --cacert {AUTHORITY} https://{hosts[0]}:8372/health")
