"""Controllers that announce Robot Web Services by multicast DNS (RFC 6762, RFC 6763).

The service is _http._tcp, its instance RobotWebServices_SYSTEM: github.com/ichbinmeraj/abb-rws-client, commit 73956659,
src/MdnsDiscovery.ts, which saw it of RobotWare 6.16 and 7.21 in RobotStudio. Not tried at a real controller.
"""

import socket
from collections.abc import Sequence
from contextlib import suppress
from time import monotonic

GROUP = ("224.0.0.251", 5353)
INSTANCE = b"RobotWebServices_"
QUESTION = b"\0\0\0\0\0\1\0\0\0\0\0\0" + b"\5_http\4_tcp\5local\0" + b"\0\x0c\0\1"
"""One question: PTR records of class IN. From a port that is not 5353 it is answered to the asker (RFC 6762, 6.7)."""
MAX_REPLY = 9000


def find_announced(interfaces: Sequence[str], limit_s: float, group: tuple[str, int] = GROUP) -> list[str]:
    """Hosts that announce themselves within `limit_s`, asked from each of this PC's addresses `interfaces`."""
    found, until_s = set(), monotonic() + limit_s
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        for interface in interfaces:
            with suppress(OSError):  # an interface without multicast
                asked.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(interface))
                asked.sendto(QUESTION, group)
        while interfaces and (left_s := until_s - monotonic()) > 0:
            asked.settimeout(left_s)
            with suppress(TimeoutError):
                reply, (host, _) = asked.recvfrom(MAX_REPLY)
                if INSTANCE in reply:
                    found.add(host)
    return sorted(found)
