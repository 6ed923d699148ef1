"""Addresses of line profilers: profiles://host:port and profiles:/folder."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from drivers.errors import AddressNotUnderstood
from protocols.gocator.data_channel import PORT

FIX = "write profiles://host, profiles://host:port or profiles:/folder"


@dataclass(frozen=True)
class ProfilerHost:
    """A sensor, or a program that speaks for it."""

    host: str
    port: int = PORT


def parse_profiler_address(address: str) -> ProfilerHost | Path:
    """Raises AddressNotUnderstood."""
    rest = address.partition(":")[2]
    if not rest.startswith("//") or rest.startswith("///"):
        folder = rest.removeprefix("//") if rest.startswith("///") else rest
        if not folder:
            raise AddressNotUnderstood(address, "host or folder is missing", FIX)
        return Path(folder)
    try:
        parts = urlsplit(address)
        host, port = parts.hostname or "", parts.port if parts.port is not None else PORT
    except ValueError as error:
        raise AddressNotUnderstood(address, str(error), FIX) from error
    if not host or not port or parts.path or parts.query:
        raise AddressNotUnderstood(address, "it is not a host and a port", FIX)
    return ProfilerHost(host, port)
