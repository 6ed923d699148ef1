"""The daemon that runs with given settings on this machine: its URL, and a client that trusts its certificate."""

from pathlib import Path

from daemon.cli.rest_client import DaemonClient
from daemon.cli.service import ANY_HOST, pinned
from daemon.config.settings import Settings


def url_of(settings: Settings) -> str:
    """Where a daemon with these settings answers on this machine."""
    server = settings.server
    host = ANY_HOST.get(server.host, server.host)
    scheme = "http" if server.certificate is None else "https"
    return f"{scheme}://[{host}]:{server.port}" if ":" in host else f"{scheme}://{host}:{server.port}"


def client_of(settings: Settings, limit_s: float) -> DaemonClient:
    """A client of that daemon, which trusts exactly the certificate that the settings name. Raises CommandError."""
    certificate = settings.server.certificate
    return DaemonClient(url_of(settings), limit_s, trust=None if certificate is None else pinned(Path(certificate)))
