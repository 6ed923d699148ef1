"""The daemon that runs with given settings on this machine: its URL, a client that trusts its certificate, its port."""

import socket

from daemon.access.tls_context import pinned
from daemon.cli.rest_client import connect
from daemon.config.server_settings import ServerSettings
from daemon.config.settings import Settings
from handeyed.client import Client

MAX_PORTS = 100
"""Ports that are tried from the usual one on."""


def client_of(settings: Settings, limit_s: float) -> Client:
    """A client of that daemon, which trusts exactly the certificate of the settings. Raises CertificateUnusable."""
    certificate = settings.server.certificate
    return connect(settings.server.local_url, limit_s, None if certificate is None else pinned(certificate))


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
