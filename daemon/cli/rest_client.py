"""The client of a command: of the service of this machine, of the daemon with given settings, or at an address."""

import json
import os
import socket
import ssl
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from daemon.access.service_key import read_authorization
from daemon.access.tls_context import pinned
from daemon.config.server_settings import ANY_HOST, ServerSettings, is_loopback
from handeyed.client import DEFAULT_URL, MAX_ANSWER_S, Client

if TYPE_CHECKING:
    from daemon.config.settings import Settings

RUNTIME = Path("/run/handeyed")
"""RuntimeDirectory= of the unit."""

READY_FILE = "daemon.json"
"""There, written by `serve --ready-file`."""

MAX_PORTS = 100
"""Ports that are tried from the usual one on."""


@dataclass(frozen=True)
class RunningService:
    """Where the service answers, the certificate it shows (None: no TLS), and what lets its group in."""

    url: str
    certificate: Path | None
    authorization: str | None

    def is_at(self, url: str) -> bool:
        """True when `url` is this service's: its port, at an address of this machine's own."""
        ours, asked = urlsplit(self.url), urlsplit(url)
        local = asked.hostname == ours.hostname or is_loopback(asked.hostname or "")
        return local and (asked.scheme, asked.port) == (ours.scheme, ours.port)


def running_service(folder: Path = RUNTIME) -> RunningService | None:
    """The service that runs; None when none does, or for somebody outside its group."""
    try:
        ready = json.loads((folder / READY_FILE).read_text(encoding="utf-8"))
        certificate = ready.get("certificate")
        url = str(ready["url"])
    except (OSError, ValueError, KeyError, AttributeError):
        return None
    for anywhere, here in ANY_HOST.items():
        url = url.replace(f"//{anywhere}:", f"//{here}:").replace(f"//[{anywhere}]:", f"//[{here}]:")
    return RunningService(url, None if certificate is None else Path(certificate), read_authorization(folder))


def connect(url: str, limit_s: float = MAX_ANSWER_S, tls: ssl.SSLContext | None = None) -> Client:
    """A client of the daemon at `url`. Raises ClientError, CertificateUnusable.

    HANDEYED_KEY holds the API key, HANDEYED_CA the authority of its certificate. Root and the service's group need
    neither for the service of this machine, which DEFAULT_URL means wherever it listens.
    """
    service = running_service()
    if service is not None and url == DEFAULT_URL:
        url = service.url
    if service is None or not service.is_at(url.rstrip("/")):
        return Client(url, tls=tls, timeout_s=limit_s)
    if tls is None and service.certificate is not None and "HANDEYED_CA" not in os.environ:
        tls = pinned(str(service.certificate))
    key = os.environ.get("HANDEYED_KEY") or (service.authorization or "").removeprefix("Bearer ")
    return Client(url, key=key, tls=tls, timeout_s=limit_s)


def client_of(settings: "Settings", limit_s: float) -> Client:
    """A client of the daemon with these settings, trusting exactly their certificate. Raises CertificateUnusable."""
    certificate = settings.server.certificate
    return connect(settings.server.local_url, limit_s, None if certificate is None else pinned(certificate))


def free_port() -> int:
    """The daemon's usual port when it is free, so that what is printed stays the same; else the next that is."""
    usual = ServerSettings()
    for port in range(usual.port, usual.port + MAX_PORTS):
        with suppress(OSError):
            socket.create_server((usual.host, port)).close()
            return port
    return 0
