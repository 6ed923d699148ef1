"""The service of this machine, as its runtime folder describes it to root and to its group."""

import json
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from daemon.access.service_key import read_authorization
from daemon.config.server_settings import ANY_HOST, is_loopback

RUNTIME = Path("/run/handeyed")
"""RuntimeDirectory= of the unit."""

READY_FILE = "daemon.json"
"""There, written by `serve --ready-file`."""


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
