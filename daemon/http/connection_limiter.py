"""Limits the number of connections: of clients that have shown a valid key and of others, each per address and in all.

A quarter of the places is for connections that have not shown a valid key. A newcomer always gets one of them, the
oldest connection of the address with the most is closed for it. A connection that has shown a key moves to the other
places and is never closed for a newcomer. So no number of connections without a key, from one address or from many,
keeps out a request with a key.
"""

import ipaddress
import resource
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol

from daemon.http.receive_buffer import BUFFER_BYTES
from daemon.http.request_pacing import RequestPacing

SPARE_DESCRIPTORS = 256
"""Descriptors reserved for files, devices and the store."""

MAX_TAKEN = 4
"""Sockets in the hands of threads at a time; other large bodies go through the event loop."""

DESCRIPTORS_PER_CONNECTION = 2
"""The socket, and the temporary file of an upload or a download."""


@dataclass(frozen=True)
class HttpLimits:
    """Limits of one connection and of their number.

    `head_s`: for a whole head. `body_s`: for a whole body until the connection has shown a valid key. After that a body
    may take `idle_s` and 1 s more for each `body_bytes_per_s`.
    `idle_s`: without progress of a body or an answer. `linger_s`: how long input is discarded after the last answer
    before closing. After closing at once the system would answer further input with a reset, and the client might never
    read why it was refused.
    """

    head_s: float = 10.0
    head_bytes: int = 32_768
    headers: int = 100
    body_s: float = 10.0
    body_bytes_per_s: float = 1000.0
    idle_s: float = 60.0
    linger_s: float = 2.0
    connections: int = 4000


class Connection(Protocol):
    """What takes a place: a TLS handshake or an HTTP connection."""

    @property
    def address(self) -> str:
        """The client's IP address."""
        ...

    def displace(self) -> None:
        """Close the connection at once, to make room for another."""
        ...


class Places:
    """A number of places for connections, of which one address may have half."""

    def __init__(self, count: int) -> None:
        self._count = max(2, count)
        self._taken: dict[str, dict[Connection, None]] = {}  # by network, the oldest first
        self._networks: dict[Connection, str] = {}

    def __len__(self) -> int:
        return len(self._networks)

    def __contains__(self, one: Connection) -> bool:
        return one in self._networks

    def has_room_for(self, newcomer: Connection) -> bool:
        """True when neither all places nor those of the newcomer's address are taken."""
        return len(self) < self._count and len(self._of(network_of(newcomer.address))) < self._count // 2

    def take(self, newcomer: Connection) -> None:
        """Give a place to the newcomer. Without a free one displace the oldest connection of the address with most."""
        network = network_of(newcomer.address)
        if not self.has_room_for(newcomer):
            crowd = self._of(network)
            if len(crowd) < self._count // 2:
                crowd = max(self._taken.values(), key=len)
            oldest = next(iter(crowd))
            self.leave(oldest)
            oldest.displace()
        self._taken.setdefault(network, {})[newcomer] = None
        self._networks[newcomer] = network

    def leave(self, one: Connection) -> None:
        """Free the place of a connection, if it has one."""
        network = self._networks.pop(one, None)
        if network is not None:
            del self._taken[network][one]
            if not self._taken[network]:
                del self._taken[network]

    def _of(self, network: str) -> dict[Connection, None]:
        return self._taken.get(network, {})


@dataclass(eq=False)
class ConnectionLimiter:
    """The places of one server, and the receive buffer, the turns and the threads that its connections share."""

    limits: HttpLimits = field(
        default_factory=lambda: HttpLimits(connections=reserve_descriptors(HttpLimits.connections))
    )
    buffer: memoryview = field(default_factory=lambda: memoryview(bytearray(BUFFER_BYTES)))
    pacing: RequestPacing = field(default_factory=RequestPacing)
    threads: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(MAX_TAKEN, "exchange"))
    taken: int = field(default=0, init=False)
    unauthenticated: Places = field(init=False)
    authenticated: Places = field(init=False)

    def __post_init__(self) -> None:
        few = self.limits.connections // 4
        self.unauthenticated, self.authenticated = Places(few), Places(self.limits.connections - few)

    def admit(self, newcomer: Connection) -> None:
        """Give a place to a new connection, which displaces another when there are too many."""
        self.unauthenticated.take(newcomer)

    def authenticate(self, one: Connection) -> None:
        """The connection has shown a valid key: from now on it is not displaced, as long as there are places.

        One that has ended meanwhile takes none.
        """
        if one in self.unauthenticated and self.authenticated.has_room_for(one):
            self.unauthenticated.leave(one)
            self.authenticated.take(one)

    def release(self, one: Connection) -> None:
        """The connection has ended."""
        self.unauthenticated.leave(one)
        self.authenticated.leave(one)


def network_of(address: str) -> str:
    """What counts as one address: an IPv4 address, or an IPv6 network of 64 bits, which one machine may have."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return address
    return str(parsed.ipv4_mapped or (int(parsed) >> 64))


def reserve_descriptors(wanted: int) -> int:
    """Raise the descriptor limit for `wanted` connections; returns how many it allows."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = DESCRIPTORS_PER_CONNECTION * wanted + SPARE_DESCRIPTORS
    if soft < needed:
        soft = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    return max(16, min(wanted, (soft - SPARE_DESCRIPTORS) // DESCRIPTORS_PER_CONNECTION))
