"""The daemon that runs with given settings on this machine: its URL, and a client that trusts its certificate."""

import ssl
from pathlib import Path

from daemon.cli.errors import CommandError
from daemon.cli.rest_client import DaemonClient
from daemon.config.settings import Settings


def url_of(settings: Settings) -> str:
    """Where a daemon with these settings answers on this machine."""
    server = settings.server
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(server.host, server.host)  # noqa: S104 - it is asked at, not listened on
    scheme = "http" if server.certificate is None else "https"
    return f"{scheme}://[{host}]:{server.port}" if ":" in host else f"{scheme}://{host}:{server.port}"


def client_of(settings: Settings, limit_s: float) -> DaemonClient:
    """A client of that daemon. Over TLS it trusts exactly the certificate that the settings name, whatever names are in
    it. Raises CommandError."""
    certificate = settings.server.certificate
    return DaemonClient(url_of(settings), limit_s, trust=None if certificate is None else pinned(Path(certificate)))


def pinned(certificate: Path) -> ssl.SSLContext:
    """TLS that accepts this certificate and no other. Raises CommandError."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False  # it is known itself, not by its name
    context.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    try:
        context.load_verify_locations(certificate)
    except (OSError, ssl.SSLError) as error:
        what = f"cannot be read ({error.strerror or error})"
        raise CommandError(str(certificate), what, "check as root or as the daemon's user") from None
    return context
