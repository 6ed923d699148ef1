"""Sockets that the daemon listens on."""

import errno
import socket

from daemon.errors import PortTaken

BACKLOG = 512
"""Connections that may wait to be accepted."""


PORT_TAKEN_FIX = "see who listens there already (ss -ltnp)"
NO_PERMISSION_FIX = "ports below 1024 need a right that the service does not have: docs/plc.md tells how to give it"


def open_listener(host: str, port: int, table: str = "server") -> socket.socket:
    """A socket that listens there; port 0 lets the system choose. `table` of the settings says so. Raises PortTaken."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family, backlog=BACKLOG)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        fix = PORT_TAKEN_FIX if error.errno != errno.EACCES else NO_PERMISSION_FIX
        whom = " for PLCs" if table == "plc" else ""
        raise PortTaken(
            f"cannot listen{whom} on {host} port {port} ({reason})",
            f"{fix}, or choose another [{table}] host or port; 0 takes any port",
        ) from None
    # Its connections inherit this. asyncio sets it only on sockets made with IPPROTO_TCP, which create_server's are
    # not: an answer's body then waits 40 ms for the client to acknowledge the head.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
