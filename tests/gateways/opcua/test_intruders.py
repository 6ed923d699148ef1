"""Clients that call OPC UA's services one by one, with another certificate or none, as no stack's own client does."""

import asyncio
import gc
import shutil
import weakref
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from asyncua import Client, ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from asyncua.server.uaprocessor import UaProcessor
from cryptography.x509.oid import ExtendedKeyUsageOID

from gateways.opcua import sessions
from gateways.opcua.vision_system import CELLS
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Bench
from tests.gateways.opcua.plant import CLIENT, Plant, PlantClient, plant, refused
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

TRUSTED, EVIL = "mes-True", "evil"
"""Names of certificates; `Plant.client` makes and trusts the first."""


class Intruder(Client):  # type: ignore[misc]
    """`shown`: the certificate that its session shows, whatever that of its channel."""

    shown: bytes | None = None

    async def enters(self, key: str) -> None:
        """Raises ua.UaError where it is refused."""
        await self.create_session()
        await self.activate_session(username="mes", password=key)
        cell = PlantClient(self, await self.get_namespace_index(CELLS))
        await cell.call("cell7.Cell.Start", "calibrate", "1")


@pytest.fixture(autouse=True)
def _any_endpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    """asyncua's client goes on though the gateway names no endpoint without encryption."""
    monkeypatch.setattr(Client, "find_endpoint", staticmethod(lambda endpoints, *_: endpoints[0]))


@asynccontextmanager
async def channel(gateway: Plant, name: str = "", shown: str = "") -> AsyncIterator[Intruder]:
    """A channel with the certificate `name`, "" without encryption; `shown` is the session's, "" none."""
    client = Intruder(gateway.endpoint, timeout=LIMIT_S)
    client.application_uri = CLIENT
    if name:
        certificate, private = gateway.folder / f"{name}.der", gateway.folder / f"{name}-key.pem"
        use = [ExtendedKeyUsageOID.CLIENT_AUTH]
        await setup_self_signed_certificate(private, certificate, CLIENT, "localhost", use, {"commonName": name})
        own = gateway.folder / "own.der"
        await client.set_security(SecurityPolicyBasic256Sha256, certificate, private, server_certificate=own)
    create = client.uaclient.create_session
    certificate_shown = (gateway.folder / f"{shown}.der").read_bytes() if shown else None

    async def create_showing(params: ua.CreateSessionParameters) -> Any:
        params.ClientCertificate = certificate_shown
        return await create(params)

    client.uaclient.create_session = create_showing
    await client.connect_socket()
    try:
        await client.send_hello()
        await client.open_secure_channel()
        yield client
    finally:
        client.disconnect_socket()


@asynccontextmanager
async def cell7(folder: Path) -> AsyncIterator[tuple[Plant, Bench, dict[str, str]]]:
    """A gateway over one daemon with keys; it has seen the trusted client, and Ready is true."""
    async with (
        with_keys(folder) as (bench, keys),
        plant(folder, {"cell7": bench.url}, {"cell7": keys["viewer"]}) as made,
    ):
        async with made.client("mes", keys["viewer"]) as mes:
            await mes.listen("cell7.Cell.Ready")
            await mes.waits("cell7.Cell.Ready", True)
        yield made, bench, keys


ATTEMPTS = {
    "no encryption": ("", "", "BadCertificateInvalid"),
    "no encryption, a copied certificate": ("", TRUSTED, "BadSecurityChecksFailed"),
    "none is shown": (EVIL, "", "BadCertificateInvalid"),
    "not trusted": (EVIL, EVIL, "BadCertificateUntrusted"),
    "a copied certificate": (EVIL, TRUSTED, "BadSecurityChecksFailed"),
    "the control": (TRUSTED, TRUSTED, "accepted"),
}
"""The certificates of channel and session, and the status of an attempt."""


async def test_a_key_is_worth_nothing_without_the_trusted_certificate_s_own(tmp_path: Path) -> None:
    async with cell7(tmp_path) as (gateway, bench, keys):
        for attempt, (name, shown, status) in ATTEMPTS.items():
            async with channel(gateway, name, shown) as intruder:
                assert await refused(intruder.enters(keys["operator"])) == status, attempt
            runs = (await bench.client.get("/runs", headers=bearer(keys["viewer"]))).json()["runs"]
            assert len(runs) == (status == "accepted"), attempt


async def test_a_file_that_is_half_a_certificate_refuses_nobody_else(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with cell7(tmp_path) as (gateway, _, keys):
        for half in ("half.der", "half.pem"):
            (gateway.folder / "trusted" / half).write_bytes(b"-----BEGIN CERTIFICATE-----\nMII")
        async with channel(gateway, TRUSTED, TRUSTED) as intruder:
            await intruder.enters(keys["operator"])
    for half in ("half.der", "half.pem"):
        assert caplog.text.count(f"{half} is not read as a certificate") == 1


async def test_no_password_ends_the_gateway(tmp_path: Path) -> None:
    async with cell7(tmp_path) as (gateway, _, keys), gateway.client("mes", keys["viewer"]) as mes:
        for key in ("schlüssel", "a\r\nX: y", "\x00", "钥匙"):
            async with channel(gateway, TRUSTED, TRUSTED) as intruder:
                assert await refused(intruder.enters(key)) == "BadUserAccessDenied"
        assert await mes.read("cell7.Cell.Ready") is True


async def test_a_connection_has_one_session(tmp_path: Path) -> None:
    async with cell7(tmp_path) as (gateway, _, _), channel(gateway, "", TRUSTED) as intruder:
        await intruder.create_session()
        for _ in range(3):
            assert await refused(intruder.create_session()) == "BadTooManySessions"


async def test_who_comes_from_the_port_of_a_client_that_was_cut_off_has_a_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a PLC after its power went: the session from before stays for a minute."""
    of_all = property(lambda _: ("10.0.0.7", 49152), lambda *_: None)
    monkeypatch.setattr(UaProcessor, "name", of_all, raising=False)
    async with cell7(tmp_path) as (gateway, _, keys), gateway.client("plc", keys["viewer"]) as plc:
        await plc.listen("cell7.Cell.Ready")
        plc.client.disconnect_socket()
        async with gateway.client("plc", keys["viewer"]) as again:
            await again.listen("cell7.Cell.Ready")
            await again.waits("cell7.Cell.Ready", True)


async def test_a_client_that_was_cut_off_returns_to_its_session_with_its_certificate_alone(tmp_path: Path) -> None:
    file, copy = tmp_path / "session.json", tmp_path / "copy.json"
    async with cell7(tmp_path) as (gateway, _, keys), gateway.client("plc", keys["viewer"], session=file) as plc:
        await plc.listen("cell7.Cell.Ready")
        plc.client.disconnect_socket()
        shutil.copy(file, copy)
        async with gateway.client("thief", keys["viewer"], session=copy) as thief:
            assert token_of(thief) != token_of(plc), "another trusted certificate gets a session of its own"
        async with channel(gateway, "thief-True") as thief_who_goes_on:
            thief_who_goes_on.uaclient.session.restore_authentication_token(token_of(plc))
            thief_who_goes_on._server_nonce = plc.client._server_nonce
            enters = thief_who_goes_on.activate_session(username="plc", password="none")
            assert await refused(enters) == "BadSecurityChecksFailed"
            reads = PlantClient(thief_who_goes_on, plc.cells).read("cell7.Cell.Ready")
            assert await refused(reads) == "BadSessionIdInvalid", "asyncua goes on with the session that was refused"
        async with gateway.client("plc", keys["viewer"], session=file) as again:
            assert token_of(again) == token_of(plc)
            await again.listen("cell7.Cell.Ready")
            await again.waits("cell7.Cell.Ready", True)


def token_of(client: PlantClient) -> Any:
    return client.client.uaclient.session.authentication_token


@pytest.mark.parametrize("after", ["", f"{TRUSTED}.der.old"], ids=["removed", "renamed"])
async def test_a_session_ends_with_its_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: str) -> None:
    monkeypatch.setattr(sessions, "RECHECK_S", 0.1)
    async with cell7(tmp_path) as (gateway, _, keys), channel(gateway, TRUSTED, TRUSTED) as intruder:
        await intruder.enters(keys["operator"])
        left = weakref.ref(
            next(one for one in gc.get_objects() if isinstance(one, sessions.KeySession) and one.external)
        )
        certificate = gateway.folder / "trusted" / f"{TRUSTED}.der"
        certificate.rename(certificate.with_name(after)) if after else certificate.unlink()
        await eventually(lambda: (session := left()) is None or not session.is_activated())


class Held:
    """A session whose check never ends, fails, or is refused."""

    def __init__(self, check: Callable[[], Awaitable[None]], *, activated: bool = True) -> None:
        self.require_trusted, self.is_activated = check, lambda: activated
        self.closed = asyncio.Event()

    async def close_session(self) -> None:
        self.closed.set()


async def test_a_check_that_hangs_or_fails_delays_no_other_session_s_end(monkeypatch: pytest.MonkeyPatch) -> None:
    async def refuse() -> None:
        raise ServiceError(ua.StatusCodes.BadUserAccessDenied)

    async def be_away() -> None:
        raise ServiceError(ua.StatusCodes.BadCommunicationError)

    async def fail() -> None:
        raise UnicodeEncodeError("ascii", "ü", 0, 1, "no")

    async def hang() -> None:
        await asyncio.Event().wait()

    monkeypatch.setattr(sessions, "RECHECK_S", 0)
    held = [Held(hang), Held(be_away), Held(fail), Held(refuse, activated=False), Held(refuse)]
    server: Any = SimpleNamespace(_external_sessions=dict(enumerate(held)))
    checking = asyncio.create_task(sessions.KeyServer.end_revoked(server))
    await asyncio.wait_for(held[-1].closed.wait(), LIMIT_S)
    assert [one.closed.is_set() for one in held] == [False] * 4 + [True]
    assert not checking.done()
    checking.cancel()
