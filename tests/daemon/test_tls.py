"""Other addresses than this machine's own: with a certificate and a key, or not at all."""

import ssl
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest

from calibration.errors import DocumentError
from daemon.access.certificates import AUTHORITY, CERTIFICATE, PRIVATE_KEY, make_certificate, require_usable
from daemon.access.errors import CertificateUnusable
from daemon.access.roles import Role
from tests.daemon.cells import serving, settings_for
from tests.daemon.test_access import TEST, bearer

HOSTS = ["localhost", "127.0.0.1", "cell-7.plant.example"]


def certificate(folder: Path) -> dict[str, str]:
    make_certificate(folder, HOSTS, datetime.now(UTC))
    return {"certificate": str(folder / CERTIFICATE), "private_key": str(folder / PRIVATE_KEY)}


def trusting(folder: Path) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=str(folder / AUTHORITY))
    context.verify_flags |= ssl.VERIFY_X509_STRICT
    return context


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
        async with httpx.AsyncClient(base_url=url, verify=trusting(tmp_path / "tls"), timeout=20) as client:
            assert (await client.get("/health")).status_code == 200
            assert (await client.get("/runs")).json()["code"] == "key-missing"  # though there are none yet
            code = bench.application.key_desk.code.text
            key = (await client.post("/setup", json={"code": code})).json()["key"]
            assert (await client.get("/runs", headers=bearer(key))).status_code == 200
        async with httpx.AsyncClient(base_url=url) as suspicious:
            with pytest.raises(httpx.ConnectError, match=r"(?i)certificate"):
                await suspicious.get("/health")
        async with httpx.AsyncClient(base_url=url.replace("https", "http")) as plain:
            with pytest.raises(httpx.HTTPError):
                await plain.get("/health")


async def test_old_protocols_are_not_spoken(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "store", server=certificate(tmp_path / "tls"))) as bench:
        assert bench.server.config.ssl is not None
        assert bench.server.config.ssl.minimum_version >= ssl.TLSVersion.TLSv1_2
        await bench.application.key_desk.add("x", Role.VIEWER, TEST)


def test_the_private_key_is_for_its_owner_only_and_nothing_is_overwritten(tmp_path: Path) -> None:
    certificate(tmp_path)
    assert (tmp_path / PRIVATE_KEY).stat().st_mode & 0o777 == 0o600
    with pytest.raises(CertificateUnusable, match="there already"):
        certificate(tmp_path)


def test_a_certificate_that_cannot_be_used_is_told(tmp_path: Path) -> None:
    good, other = certificate(tmp_path / "a"), certificate(tmp_path / "b")
    require_usable(**good)
    (tmp_path / "nonsense").write_text("nonsense")
    for pair in (
        (good["certificate"], other["private_key"]),
        (good["private_key"], good["certificate"]),
        (str(tmp_path / "nonsense"), good["private_key"]),
        (str(tmp_path / "nowhere"), good["private_key"]),
    ):
        with pytest.raises(CertificateUnusable, match="handeyed tls init"):
            require_usable(*pair)
