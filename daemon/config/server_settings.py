"""The sections [server] and [[webhooks]] of the settings."""

import ipaddress
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, model_validator

from calibration.documents.validation import Document

Topic = Literal["run.ended", "calibration.stored", "calibration.applied", "scan.view", "alarm"]

ANY_HOST = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - where to ask one that listens at every address


def is_loopback(host: str) -> bool:
    """True for addresses that only this machine can reach."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _validate_http_url(url: str) -> str:
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.username or parts.fragment:
        raise ValueError("give http://HOST:PORT/PATH or https://..., without user and fragment")
    return url


def without_brackets(host: str) -> str:
    """An address as in a setting, or as in a URL: `[::1]` is `::1`."""
    return host[1:-1] if host[:1] + host[-1:] == "[]" else host


HostName = Annotated[str, Field(min_length=1, max_length=253, pattern=r"^[A-Za-z0-9._-]+$")]


class ServerSettings(Document):
    """The address of the REST interface. Any but a loopback address needs a certificate and keys.

    `idle_minutes`: without a touch for this long a browser's session may only read; 0: never.
    """

    host: Annotated[str, AfterValidator(without_brackets)] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8372
    allowed_hosts: tuple[HostName, ...] = ()
    certificate: str | None = None
    private_key: str | None = None
    body_limit_mb: Annotated[float, Field(gt=0, le=65536)] = 2048.0
    idle_minutes: Annotated[float, Field(ge=0, le=720)] = 15.0
    log_level: Literal["debug", "info", "warning", "error"] = "info"

    @model_validator(mode="after")
    def _check_certificate(self) -> "ServerSettings":
        if (self.certificate is None) != (self.private_key is None):
            raise ValueError("certificate and private_key belong together: give both, or neither")
        if not self.loopback and self.certificate is None:
            raise ValueError(
                f"host {self.host!r} can be reached by others: give certificate and private_key ('handeyed tls init'"
                " makes them), or use 127.0.0.1"
            )
        return self

    @property
    def local_url(self) -> str:
        """Where a daemon with these settings answers on this machine."""
        host = ANY_HOST.get(self.host, self.host)
        scheme = "http" if self.certificate is None else "https"
        return f"{scheme}://[{host}]:{self.port}" if ":" in host else f"{scheme}://{host}:{self.port}"

    @property
    def loopback(self) -> bool:
        return is_loopback(self.host)

    def beside(self, folder: Path) -> "ServerSettings":
        """A copy with relative files resolved against `folder`, that of the settings file."""
        if self.certificate is None or self.private_key is None:
            return self
        files = {"certificate": str(folder / self.certificate), "private_key": str(folder / self.private_key)}
        return self.model_copy(update=files)


class WebhookSettings(Document):
    """A receiver of messages. `secret_file` holds the secrets that sign them, 32 bytes or more per line."""

    receiver: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]
    url: Annotated[str, Field(max_length=2000), AfterValidator(_validate_http_url)]
    secret_file: Annotated[str, Field(min_length=1)]
    ca_file: Annotated[str, Field(min_length=1)] | None = None
    """The authority of the receiver's certificate, PEM; without it the public authorities count."""

    topics: tuple[Topic, ...] = ()

    def beside(self, folder: Path) -> "WebhookSettings":
        """A copy with relative files resolved against `folder`, that of the settings file."""
        authority = None if self.ca_file is None else str(folder / self.ca_file)
        return self.model_copy(update={"secret_file": str(folder / self.secret_file), "ca_file": authority})
