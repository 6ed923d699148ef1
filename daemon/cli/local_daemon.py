"""The daemon that runs with given settings on this machine: its URL, a client that trusts its certificate, its port."""

import socket
from pathlib import Path

from daemon.cli.rest_client import connect
from daemon.cli.service import ANY_HOST, pinned
from daemon.config.server_settings import ServerSettings
from daemon.config.settings import Settings
from handeyed.client import Client

MAX_PORTS = 100
"""Ports that are tried from the usual one on."""


def url_of(settings: Settings) -> str:
    """Where a daemon with these settings answers on this machine."""
    server = settings.server
    host = ANY_HOST.get(server.host, server.host)
    scheme = "http" if server.certificate is None else "https"
    return f"{scheme}://[{host}]:{server.port}" if ":" in host else f"{scheme}://{host}:{server.port}"


def client_of(settings: Settings, limit_s: float) -> Client:
    """A client of that daemon, which trusts exactly the certificate that the settings name. Raises CommandError."""
    certificate = settings.server.certificate
    return connect(url_of(settings), limit_s, None if certificate is None else pinned(Path(certificate)))


def free_port() -> int:
    """The daemon's usual port when it is free, so that what is printed stays the same; else the next that is."""
    usual = ServerSettings()
    for port in range(usual.port, usual.port + MAX_PORTS):
        try:
            socket.create_server((usual.host, port)).close()
        except OSError:
            continue
        return port
    return 0
