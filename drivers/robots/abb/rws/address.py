"""Parses rws://user:password@host:port?version=2&frame=wobj&mechunit=ROB_1&certificate=/file.pem&password_file=/file."""

from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlsplit

import httpx

from drivers.errors import AddressNotUnderstood, RequestRefused
from registration.io.regular_file import read_regular

USER, PASSWORD = "Default User", "robotics"
"""The defaults of every controller."""
SCHEMES = {2: "https", 1: "http"}
"""Versions in the order they are tried."""
FRAMES = {"wobj": "Wobj", "base": "Base", "world": "World"}
MAX_PASSWORD_BYTES = 4096
_OPTIONS = {"version", "frame", "mechunit", "certificate", "password_file"}
_EXAMPLE = "write rws://host, or rws://user:password@host:port?version=2&frame=base"


@dataclass(frozen=True)
class RwsAddress:
    """Address and options of the services. `version` None: detected. `certificate`: the only one trusted."""

    host: str
    port: int | None = None
    user: str = USER
    password: str = field(default=PASSWORD, repr=False)
    password_file: Path | None = None
    version: int | None = None
    frame: str = "wobj"
    mechunit: str = "ROB_1"
    certificate: Path | None = None

    @classmethod
    def parse(cls, address: str) -> "RwsAddress":
        """Parse; opens nothing. Raises AddressNotUnderstood, which shows no password."""
        scheme, separator, rest = address.partition("://")
        shown = scheme + separator + rest.rpartition("@")[2] if separator else address
        try:
            parts = urlsplit(address)
            port = parts.port
            httpx.URL(scheme="http", host=parts.hostname or "").host.encode("idna")  # refuse what no resolver takes
        except (ValueError, httpx.InvalidURL) as error:
            raise AddressNotUnderstood(shown, str(error), _EXAMPLE) from None
        options = dict(parse_qsl(parts.query, keep_blank_values=True))
        other = "" if parts.scheme == "rws" else "this is done over Robot Web Services"
        wrong = other or _address_problem(parts.hostname, parts.path, options)
        if wrong:
            raise AddressNotUnderstood(shown, wrong, _EXAMPLE)
        return cls(
            host=parts.hostname or "",
            port=port,
            user=unquote(parts.username) if parts.username else USER,
            password=unquote(parts.password) if parts.password is not None else PASSWORD,
            password_file=Path(options["password_file"]) if "password_file" in options else None,
            version=int(options["version"]) if "version" in options else None,
            frame=options.get("frame", "wobj"),
            mechunit=options.get("mechunit", "ROB_1"),
            certificate=Path(options["certificate"]) if "certificate" in options else None,
        )

    @property
    def address(self) -> str:
        """Address for messages, without user and password."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"rws://{host}" + (f":{self.port}" if self.port else "")

    def url(self, version: int) -> str:
        """Base URL of one version, without a trailing slash."""
        return self.address.replace("rws", SCHEMES[version], 1)

    def secret(self, device: str) -> str:
        """The password, read from its file when one is named. Raises RequestRefused."""
        if self.password_file is None:
            return self.password
        try:
            return read_regular(self.password_file, MAX_PASSWORD_BYTES).decode().strip()
        except (OSError, UnicodeDecodeError) as error:
            what = f"the password file {self.password_file} cannot be read ({error})"
            raise RequestRefused(device, what, "correct password_file in the address", "NO_PASSWORD") from error


def _address_problem(host: str | None, path: str, options: dict[str, str]) -> str:
    unknown = sorted(options.keys() - _OPTIONS)
    checks = (
        (not host, "the host is missing"),
        (path not in ("", "/"), f"it has a path, {path}"),
        (bool(unknown), f"unknown option {unknown[0]!r}" if unknown else ""),
        (options.get("version", "1") not in ("1", "2"), "version is 1 or 2"),
        (options.get("frame", "wobj") not in FRAMES, f"frame is one of {', '.join(FRAMES)}"),
        (not all(options.values()), "an option has no value"),
    )
    return next((words for wrong, words in checks if wrong), "")
