"""Open listening sockets."""

import errno
import socket
from collections.abc import Mapping

from calibration.sentences.sentence import Sentence
from daemon.errors import PortTaken
from drivers.transports.late_address import allow_late_address, is_here

BACKLOG = 4096
"""Maximum number of connections that wait to be accepted. The system drops what comes beyond, and the client asks again
after a second or more.
"""

PORT_TAKEN_FIX = "see who listens there already (ss -ltnp)"
NO_PERMISSION_FIX = "ports below 1024 need a right that the service does not have: see docs/plc.md"


def open_listener(host: str, port: int, table: str = "server") -> socket.socket:
    """A listening TCP socket; port 0 lets the system choose. `table`: settings section to name. Raises PortTaken.

    An address that this machine does not have yet is waited for: see `late_addresses`.
    """
    listener = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        allow_late_address(listener)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # also right after an end, as create_server does
        if listener.family == socket.AF_INET6:
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.bind((host, port))
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        reason = (error.strerror or str(error)).lower()
        fix = PORT_TAKEN_FIX if error.errno != errno.EACCES else NO_PERMISSION_FIX
        whom = " for PLCs" if table == "plc" else ""
        raise PortTaken(
            f"cannot listen{whom} on {host} port {port} ({reason})",
            f"{fix}, or choose another [{table}] host or port; 0 takes any port",
        ) from None
    # Connections inherit TCP_NODELAY. asyncio sets it only on sockets made with IPPROTO_TCP, which this one is not:
    # without it an answer's body waits 40 ms until the client acknowledges the head.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, 65_536)  # else minutes of pictures wait in there
    return listener


def late_addresses(hosts: Mapping[str, str]) -> list[str]:
    """A warning of each address to listen at, by its section of the settings, that this machine does not have now."""
    return [Sentence("address-not-here", table=table, host=host) for table, host in hosts.items() if not is_here(host)]
