"""Both services of one controller on their ports: 1.0 over HTTP, 2.0 over HTTPS."""

import asyncio
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.devices.http_server import HttpServer
from mock_robot.faults.board import FaultBoard
from mock_robot.rws.service import Service
from mock_robot.rws.world import World

PING_S = 30.0
_SOCKETS: dict[str, Any] = {"ws_ping_interval": PING_S, "ws_ping_timeout": None, "ws_per_message_deflate": False}


class _NeverPongs(WebSocketsSansIOProtocol):
    """WebSocket protocol that leaves a client's pings unanswered, as RWS 2.0 does."""

    def handle_ping(self) -> None:
        self.conn.data_to_send()


@dataclass(frozen=True)
class RwsUrls:
    first: str
    second: str


class RwsStation:
    """The services, and the world they share."""

    def __init__(self, cabinet: Cabinet, faults: FaultBoard, clock: Callable[[], float]) -> None:
        self.world = World(cabinet, faults, clock)
        self.first, self.second = Service(self.world, 1), Service(self.world, 2)
        self._servers: list[HttpServer] = []

    async def start(self, host: str, port_1: int, port_2: int) -> RwsUrls:
        self.world.address = host
        if not self.world.cabinet.recorded:
            self.world.cabinet.record(self.world.clock(), 10017, "automatic mode confirmed")

        plain = HttpServer(self.first, ws="websockets-sansio", **_SOCKETS)
        with tempfile.TemporaryDirectory() as folder:  # the certificate is read when the server is created
            certificate, key = write_self_signed(Path(folder), host)
            files = {"ssl_certfile": str(certificate), "ssl_keyfile": str(key)}
            secured = HttpServer(self.second, ws=_NeverPongs, **_SOCKETS, **files)
            urls = RwsUrls(await plain.start(host, port_1), await secured.start(host, port_2))
        self._servers = [plain, secured]
        return urls

    def nudge(self) -> None:
        self.first.react_to_controller()
        self.second.react_to_controller()

    async def close(self) -> None:
        await asyncio.gather(*(server.close() for server in self._servers))


LIFETIME = timedelta(days=365)


def write_self_signed(folder: Path, address: str) -> tuple[Path, Path]:
    """Write certificate and key for an IP address as PEM files in `folder`; returns their paths."""
    from cryptography import x509  # slow import: only where it is served
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "handeyed mock controller")])
    began = datetime.now(UTC) - timedelta(hours=1)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(began)
        .not_valid_after(began + LIFETIME)
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address(address))]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    certificate_file, key_file = folder / "certificate.pem", folder / "key.pem"
    certificate_file.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    plain = serialization.NoEncryption()
    key_file.write_bytes(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, plain))
    return certificate_file, key_file
