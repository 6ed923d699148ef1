"""Open listening sockets."""

import errno
import socket

from daemon.errors import PortTaken

BACKLOG = 4096
"""Maximum number of connections that wait to be accepted. The system drops what comes beyond, and the client asks again
after a second or more.
"""

PORT_TAKEN_FIX = "see who listens there already (ss -ltnp)"
NO_PERMISSION_FIX = "ports below 1024 need a right that the service does not have: see docs/plc.md"


def open_listener(host: str, port: int, table: str = "server") -> socket.socket:
    """A listening TCP socket; port 0 lets the system choose. `table`: settings section to name. Raises PortTaken."""
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
    # Connections inherit TCP_NODELAY. asyncio sets it only on sockets made with IPPROTO_TCP, which those of
    # create_server are not: without it an answer's body waits 40 ms until the client acknowledges the head.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
