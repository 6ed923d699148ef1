"""Numeric addresses, and listening before one is there: after a power cut the network is often up after the daemon.

Linux lets a socket be bound to such an address (IP_FREEBIND, ip(7)); it receives from when the address is there.
"""

import ipaddress
import socket
from contextlib import suppress

IP_FREEBIND = 15
IPV6_FREEBIND = 78
"""Of linux/in.h and linux/in6.h; Python names neither."""


def allow_late_address(unbound: socket.socket) -> None:
    """Let `unbound` be bound to an address that is not here yet; does nothing on another system than Linux."""
    six = unbound.family == socket.AF_INET6
    level, option = (socket.IPPROTO_IPV6, IPV6_FREEBIND) if six else (socket.IPPROTO_IP, IP_FREEBIND)
    with suppress(OSError):
        unbound.setsockopt(level, option, 1)


def is_address(host: str) -> bool:
    """True for a numeric address, False for a name."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def is_here(host: str) -> bool:
    """True when the numeric address `host` is one of this machine's now, and for a name, which nobody can bind late."""
    try:
        family = socket.AF_INET6 if ipaddress.ip_address(host.partition("%")[0]).version == 6 else socket.AF_INET
    except ValueError:
        return True
    with socket.socket(family, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind((host, 0))
        except OSError:
            return False
    return True
