"""The client of a command: of the service of this machine, or of the daemon at an address."""

import os
import ssl

from daemon.access.tls_context import pinned
from daemon.cli.service import running_service
from handeyed.client import DEFAULT_URL, MAX_ANSWER_S, Client


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
