"""The service of this machine, as its runtime folder describes it to root and to its group."""

import ipaddress
import json
import ssl
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from daemon.access.service_key import read_authorization
from daemon.cli.errors import CommandError

RUNTIME = Path("/run/handeyed")
"""RuntimeDirectory= of the unit."""

READY_FILE = "daemon.json"
"""There, written by `serve --ready-file`."""

ANY_HOST = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - where to ask one that listens at every address


@dataclass(frozen=True)
class RunningService:
    """Where the service answers, the certificate it shows (None: no TLS), and what lets its group in."""

    url: str
    certificate: Path | None
    authorization: str | None

    def is_at(self, url: str) -> bool:
        """True when `url` is this service's: its port, at an address of this machine's own."""
        ours, asked = urlsplit(self.url), urlsplit(url)
        local = asked.hostname == ours.hostname or asked.hostname == "localhost" or _is_loopback(asked.hostname or "")
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


def pinned(certificate: Path) -> ssl.SSLContext:
    """TLS that accepts this certificate and no other, whatever names are in it. Raises CommandError."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False  # it is known itself, not by its name
    context.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    try:
        context.load_verify_locations(certificate)
    except (OSError, ssl.SSLError) as error:
        reason = (error.strerror or str(error)).lower()
        raise CommandError(
            str(certificate), f"cannot be read ({reason})", "ask as root or as the daemon's user"
        ) from None
    return context


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
