"""What the server of a stream says to one request: OpenCV tells nothing of it, and waits for 30 s."""

import http.client
import re
import socket
import ssl
from urllib.parse import urlsplit

from drivers.errors import DeviceError, DeviceUnreachable, GarbledAnswer

PORTS = {"rtsp": 554, "rtsps": 322, "http": 80, "https": 443}
STATUS = re.compile(rb"(?:RTSP|HTTP)/\d\.\d (\d{3}) ?([^\r\n]{0,80})")
TO_SIGN_IN = 401
"""The player signs in by itself, with the user and password of the address."""


def refusal_of(url: str, device: str, limit_s: float) -> DeviceError | None:
    """Why the server does not give this stream; None where it does, or where only the player can know.

    Waits for `limit_s` at most for the connection and for the answer.
    """
    parts = urlsplit(url)
    if parts.scheme not in PORTS or parts.hostname is None:
        return None
    address = (parts.hostname, parts.port or PORTS[parts.scheme])
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # whoever it is: the player decides whether to trust the certificate
    tls.check_hostname, tls.verify_mode = False, ssl.CERT_NONE
    try:
        with (
            socket.create_connection(address, limit_s) as plain,
            tls.wrap_socket(plain, server_hostname=parts.hostname) if parts.scheme.endswith("s") else plain as server,
        ):
            server.sendall(_request(parts.scheme, parts.hostname, url, parts.path, parts.query))
            answer = server.recv(256)
    except TimeoutError:
        return None
    except ssl.SSLError as error:
        return GarbledAnswer(device, f"no TLS with {address[0]}:{address[1]} ({error.reason})", "check scheme and port")
    except OSError as error:
        what = f"nobody answers at {address[0]}:{address[1]} ({error.strerror or error})"
        return DeviceUnreachable(device, what, "check that the device is on, the address and the port")
    found = STATUS.match(answer)
    if found is None or (status := int(found[1])) < 400 or status == TO_SIGN_IN:
        return None
    reason = found[2].decode("latin-1").strip() or http.client.responses.get(status, "")
    what = f"the stream's server answers {status} {reason}"
    if status >= 500:
        return DeviceUnreachable(device, what, "the device is not ready; look at it")
    return GarbledAnswer(device, what, "check path, user and password of the address")


def _request(scheme: str, host: str, url: str, path: str, query: str) -> bytes:
    if scheme.startswith("rtsp"):
        bare = urlsplit(url)._replace(netloc=urlsplit(url).netloc.rpartition("@")[2]).geturl()
        return f"DESCRIBE {bare} RTSP/1.0\r\nCSeq: 1\r\nAccept: application/sdp\r\n\r\n".encode()
    target = (path or "/") + (f"?{query}" if query else "")
    return f"GET {target} HTTP/1.0\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode()
