"""Other addresses than this machine's own: with a certificate and a key, or not at all."""

import asyncio
import socket
import ssl
import time
import warnings
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
import uvloop

from calibration.errors import DocumentError
from daemon.access.certificates import PRIVATE_KEY
from daemon.access.errors import CertificateUnusable
from daemon.access.roles import Role
from daemon.access.tls_context import server_context
from daemon.http.connection_limiter import ConnectionLimiter, HttpLimits
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.http.tls_files import certificate, trusting
from tests.support.waiting import LIMIT_S, eventually


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "cell-7.plant.example", "0"])
def test_another_address_without_a_certificate_is_refused(tmp_path: Path, host: str) -> None:
    with pytest.raises(DocumentError, match="handeyed tls init"):
        settings_for(tmp_path, server={"host": host})


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost", "127.0.0.7"])
def test_this_machines_own_addresses_need_none(tmp_path: Path, host: str) -> None:
    assert settings_for(tmp_path, server={"host": host}).server.loopback


async def test_others_are_served_over_tls_and_asked_for_a_key_from_the_start(tmp_path: Path) -> None:
    server = {"host": "0.0.0.0", **certificate(tmp_path / "tls")}
    async with serving(settings_for(tmp_path / "store", server=server)) as bench:
        assert bench.url.startswith("https://0.0.0.0:")
        url = bench.url.replace("0.0.0.0", "localhost")
        async with httpx.AsyncClient(base_url=url, verify=trusting(tmp_path / "tls"), timeout=LIMIT_S) as client:
            assert (await client.get("/health")).status_code == 200
            assert (await client.get("/runs")).json()["code"] == "key-missing"  # though there are none yet
            code = bench.application.key_service.code.text
            key = (await client.post("/setup", json={"code": code})).json()["key"]
            assert (await client.get("/runs", headers=bearer(key))).status_code == 200
        async with httpx.AsyncClient(base_url=url, timeout=LIMIT_S) as suspicious:
            with pytest.raises(httpx.ConnectError, match=r"(?i)certificate"):
                await suspicious.get("/health")
        async with httpx.AsyncClient(base_url=url.replace("https", "http"), timeout=LIMIT_S) as plain:
            with pytest.raises(httpx.HTTPError):
                await plain.get("/health")


async def test_old_protocols_are_not_spoken(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "store", server=certificate(tmp_path / "tls"))) as bench:
        key, _ = await bench.application.key_service.add("x", Role.VIEWER, TEST)
        old = trusting(tmp_path / "tls")
        old.set_ciphers("ALL:@SECLEVEL=0")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            old.minimum_version, old.maximum_version = ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1
        url = bench.url.replace("127.0.0.1", "localhost")
        async with httpx.AsyncClient(base_url=url, verify=old, timeout=LIMIT_S) as client:
            with pytest.raises(httpx.ConnectError):
                await client.get("/health")
        for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):
            exactly = trusting(tmp_path / "tls")
            exactly.minimum_version = exactly.maximum_version = version
            async with httpx.AsyncClient(base_url=url, verify=exactly, timeout=LIMIT_S) as client:
                assert (await client.get("/runs", headers=bearer(key))).status_code == 200


@pytest.mark.parametrize("loops", [asyncio.new_event_loop, uvloop.new_event_loop])
@pytest.mark.parametrize("sent", [b"", b"\x16\x03\x01\x02"])
def test_handshakes_that_never_end_make_room_and_are_cut_off(
    tmp_path: Path, loops: Callable[[], asyncio.AbstractEventLoop], sent: bytes
) -> None:
    """Three times as many as there may be connections: health answers all the while."""
    limits = HttpLimits(head_s=1.0, connections=10)

    async def scanned() -> None:
        door = ConnectionLimiter(limits)
        async with serving(settings_for(tmp_path / "store", server=certificate(tmp_path / "tls")), door=door) as bench:
            url = bench.url.replace("127.0.0.1", "localhost")
            host = urlsplit(bench.url)
            half = []
            for _ in range(3 * limits.connections):
                reader, writer = await asyncio.open_connection(host.hostname, host.port)
                writer.write(sent)
                half.append((reader, writer))
            for _ in range(5):
                async with httpx.AsyncClient(
                    base_url=url, verify=trusting(tmp_path / "tls"), timeout=LIMIT_S
                ) as client:
                    assert (await connecting(lambda: client.get("/health"), limits.head_s)).status_code == 200
                assert len(door.unauthenticated) <= limits.connections // 4
            for reader, writer in half:
                with suppress(ConnectionError):
                    assert await asyncio.wait_for(reader.read(), LIMIT_S) == b""
                writer.close()
            await eventually(lambda: not len(door.unauthenticated))

    with asyncio.Runner(loop_factory=loops) as runner:
        runner.run(scanned())


async def connecting(ask: Callable[[], Awaitable[httpx.Response]], head_s: float) -> httpx.Response:
    """The first answer; on a busy machine the client's own handshake may take longer than `head_s`, and is cut off."""
    while True:
        began_s = time.perf_counter()
        try:
            return await ask()
        except httpx.TransportError:
            if time.perf_counter() - began_s < head_s:
                raise


@pytest.mark.parametrize("loops", [asyncio.new_event_loop, uvloop.new_event_loop])
def test_a_request_in_the_handshakes_last_packet_is_heard(
    tmp_path: Path, loops: Callable[[], asyncio.AbstractEventLoop]
) -> None:
    async def told() -> bytes:
        async with serving(settings_for(tmp_path / "store", server=certificate(tmp_path / "tls"))) as bench:
            return await asyncio.to_thread(at_once, urlsplit(bench.url).port or 0, trusting(tmp_path / "tls"))

    with asyncio.Runner(loop_factory=loops) as runner:
        assert runner.run(told()).startswith(b"HTTP/1.1 200")


def at_once(port: int, trust: ssl.SSLContext) -> bytes:
    """The end of a handshake and a whole request in one send."""
    incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
    tls = trust.wrap_bio(incoming, outgoing, server_hostname="localhost")
    with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as connection:

        def heard() -> None:
            connection.sendall(outgoing.read())
            came = connection.recv(65536)
            assert came, "the connection was closed"
            incoming.write(came)

        while True:
            try:
                tls.do_handshake()
                break
            except ssl.SSLWantReadError:
                heard()
        tls.write(b"GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        while True:
            try:
                return tls.read()
            except ssl.SSLWantReadError:
                heard()


def test_the_private_key_is_for_its_owner_only_and_nothing_is_overwritten(tmp_path: Path) -> None:
    certificate(tmp_path)
    assert (tmp_path / PRIVATE_KEY).stat().st_mode & 0o777 == 0o600
    with pytest.raises(CertificateUnusable, match="there already"):
        certificate(tmp_path)


def test_a_certificate_that_cannot_be_used_is_reported(tmp_path: Path) -> None:
    good, other = certificate(tmp_path / "a"), certificate(tmp_path / "b")
    server_context(**good)
    (tmp_path / "nonsense").write_text("nonsense")
    for pair in (
        (good["certificate"], other["private_key"]),
        (good["private_key"], good["certificate"]),
        (str(tmp_path / "nonsense"), good["private_key"]),
        (str(tmp_path / "nowhere"), good["private_key"]),
    ):
        with pytest.raises(CertificateUnusable, match="handeyed tls init"):
            server_context(*pair)
