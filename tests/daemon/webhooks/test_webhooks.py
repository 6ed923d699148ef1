"""The MES is told: signed, in order, at least once, also by the daemon after a kill."""

import asyncio
import base64
import hashlib
import hmac
import sqlite3
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from daemon.access.certificates import AUTHORITY
from daemon.access.errors import CertificateUnusable
from daemon.access.tls_context import server_context
from daemon.config.server_settings import WebhookSettings
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.runtime.clock import Clock
from daemon.store.database import DATABASE_NAME
from daemon.store.store import Store
from daemon.webhooks.dispatcher import (
    MAX_ATTEMPTS_WHEN_REFUSED,
    MAX_PAUSE_S,
    MIN_FAILURES_TO_WARN,
    SecretUnusable,
    WebhookDispatcher,
    pause_s,
    read_secrets,
    signature,
    signature_headers,
)
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.http.tls_files import certificate
from tests.daemon.save_paths import pending_counts
from tests.daemon.webhooks.receiver import Receiver, receiving
from tests.support.waiting import eventually

SECRET = b"0123456789abcdef0123456789abcdef"
AT = "2026-11-21T09:00:00.000Z"


def test_the_signature_is_that_of_the_standards_own_example() -> None:
    """Standard Webhooks 1.0.0, reference implementations' test vector."""
    secret = base64.b64decode("MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")
    expected = "g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="
    assert signature("msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}', secret) == expected


def test_two_secrets_make_two_signatures() -> None:
    both = signature_headers("m", 1, b"{}", [b"a" * 32, b"b" * 32])["webhook-signature"].split(" ")
    assert both == [f"v1,{signature('m', 1, b'{}', secret * 32)}" for secret in (b"a", b"b")]


@pytest.mark.parametrize("content", [None, b"", b"short", b"whsec_!!!", b"0123456789abcdef0123456789abcdef\nshort"])
def test_a_secret_that_cannot_be_one_is_reported(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "secret"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(SecretUnusable, match=r"openssl rand -hex 32"):
        read_secrets(file)


def test_pauses_double_up_to_a_limit_and_are_spread() -> None:
    assert [pause_s(n, 1.0) for n in (1, 2, 3, 4)] == [1, 2, 4, 8]
    assert pause_s(1000, 1.0) == MAX_PAUSE_S
    assert pause_s(3, 0.0) == 2.0


@pytest.fixture
async def store(tmp_path: Path) -> Any:
    store = Store(tmp_path)
    yield store
    await store.close()


def webhook(folder: Path, receiver: Receiver, **changes: Any) -> WebhookSettings:
    (folder / "secret").write_bytes(SECRET + b"\n")
    return WebhookSettings(receiver="mes", url=receiver.url, secret_file=str(folder / "secret"), **changes)


def dispatcher(store: Store, hook: WebhookSettings, sleep: Callable[[float], Awaitable[None]] | None = None) -> Any:
    async def at_once(seconds: float) -> None:
        await asyncio.sleep(0)

    return WebhookDispatcher((hook,), store.outbox, Clock(sleep=sleep or at_once), lambda: 1.0)


async def apply_some(store: Store, *names: str) -> None:
    for name in names:
        await store.save_calibration(CalibrationRecord(name, None, AT, True, a_calibration(name)))
        await store.apply(AppliedCalibration(name, AT, "Ann"))


async def test_messages_come_in_order_signed_and_with_ids_of_their_own(store: Store, tmp_path: Path) -> None:
    async with receiving() as mes:
        sending = dispatcher(store, webhook(tmp_path, mes))
        await sending.start()
        await apply_some(store, "a", "b")
        bodies = await mes.has(4)
        assert [body["type"] for body in bodies] == ["calibration.stored", "calibration.applied"] * 2
        applied = {"calibration_id": "a", "applied_by": "Ann", "sequence": 1, "camera": "camera"}
        assert bodies[1]["data"] == {**applied, **a_calibration("a").accuracy.fields()}
        assert len({body["id"] for body in bodies}) == 4
        for headers, body in mes.got:
            content = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
            expected = base64.b64encode(hmac.new(SECRET, content, hashlib.sha256).digest()).decode()
            assert headers["webhook-signature"] == f"v1,{expected}"
        await sending.stop()


async def test_a_plant_s_own_authority_counts_where_it_is_named(store: Store, tmp_path: Path) -> None:
    tls = certificate(tmp_path / "tls")
    async with receiving(tls=server_context(tls["certificate"], tls["private_key"])) as mes:
        stranger = dispatcher(store, webhook(tmp_path, mes))
        await stranger.start()
        await apply_some(store, "a")
        await eventually(lambda: stranger.failures["mes"] >= MIN_FAILURES_TO_WARN)
        await stranger.stop()
        assert not mes.got
        trusting = dispatcher(store, webhook(tmp_path, mes, ca_file=str(tmp_path / "tls" / AUTHORITY)))
        await trusting.start()
        assert [body["type"] for body in await mes.has(2)] == ["calibration.stored", "calibration.applied"]
        await trusting.stop()


async def test_an_authority_that_is_none_is_refused_at_the_start(store: Store, tmp_path: Path) -> None:
    async with receiving() as mes:
        hook = webhook(tmp_path, mes, ca_file=str(tmp_path / "secret"))
        with pytest.raises(CertificateUnusable, match=r"secret: cannot be read.*in PEM"):
            await dispatcher(store, hook).start()


async def test_what_is_not_taken_comes_again_the_same_and_before_anything_later(store: Store, tmp_path: Path) -> None:
    paused: list[float] = []

    async def sleep(seconds: float) -> None:
        paused.append(seconds)
        await asyncio.sleep(0)

    async with receiving(500, 0, 301, 429) as mes:
        sending = dispatcher(store, webhook(tmp_path, mes, topics=("calibration.applied",)), sleep)
        await sending.start()
        await apply_some(store, "a", "b")
        bodies = await mes.has(6)
        assert bodies[:4] == [bodies[4]] * 4
        assert [body["data"]["sequence"] for body in bodies[4:]] == [1, 2]
        assert paused == [1, 2, 4, 8]
        await sending.stop()


async def test_a_message_that_is_never_taken_does_not_stop_those_behind_it(store: Store, tmp_path: Path) -> None:
    async with receiving(*[422] * MAX_ATTEMPTS_WHEN_REFUSED) as mes:
        sending = dispatcher(store, webhook(tmp_path, mes, topics=("calibration.applied",)))
        await sending.start()
        await apply_some(store, "a", "b")
        bodies = await mes.has(MAX_ATTEMPTS_WHEN_REFUSED + 1)
        assert [body["data"]["sequence"] for body in bodies] == [1] * MAX_ATTEMPTS_WHEN_REFUSED + [2]
        await sending.stop()


async def test_a_damaged_message_is_left_out_and_does_not_stop_those_behind_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store = Store(tmp_path)
    await store.outbox.subscribe("mes")
    for detail in ("before", "lost", "garbled", "behind"):
        await store.outbox.post("alarm", AT, {"what": detail})
    await store.close()
    with sqlite3.connect(tmp_path / DATABASE_NAME) as db:
        db.execute("UPDATE outbox SET data = '{\"what\": ' WHERE data LIKE '%lost%'")
        db.execute("UPDATE outbox SET data = CAST(x'7b2277ff' AS TEXT) WHERE data LIKE '%garbled%'")
    db.close()
    store = Store(tmp_path)
    async with receiving() as mes:
        sending = dispatcher(store, webhook(tmp_path, mes))
        await sending.start()
        assert [body["data"]["what"] for body in await mes.has(2)] == ["before", "behind"]
        await sending.stop()
    await store.close()
    assert "for webhook mes is damaged" in caplog.text


async def test_a_receiver_that_was_away_may_refuse_once_and_gets_the_message(store: Store, tmp_path: Path) -> None:
    """A proxy that answers 400 while what is behind it starts, after a night without an answer, loses nothing."""
    away = [0, 502, 503] * MAX_ATTEMPTS_WHEN_REFUSED
    async with receiving(*away, 400) as mes:
        sending = dispatcher(store, webhook(tmp_path, mes, topics=("calibration.applied",)))
        await sending.start()
        await apply_some(store, "a", "b")
        bodies = await mes.has(len(away) + 3)
        assert [body["data"]["sequence"] for body in bodies] == [1] * (len(away) + 2) + [2]
        await sending.stop()


async def test_refusals_of_before_count_no_longer_after_new_settings(store: Store, tmp_path: Path) -> None:
    refused = MAX_ATTEMPTS_WHEN_REFUSED - 1
    async with receiving(*[400] * refused, *[503] * 10_000) as mes:
        hook = webhook(tmp_path, mes, topics=("calibration.applied",))
        sending = dispatcher(store, hook)
        await sending.start()
        await apply_some(store, "a")
        await mes.has(refused + 1)
        await sending.change(())
        mes.statuses[:] = [400]
        before = len(mes.got)
        await sending.change((hook,))
        assert [body["data"]["sequence"] for body in await mes.has(before + 2)][before:] == [1, 1]
        await sending.stop()


async def test_a_new_receiver_does_not_get_the_past_and_a_known_one_misses_nothing(tmp_path: Path) -> None:
    async with receiving() as mes:
        store = Store(tmp_path)
        await apply_some(store, "before")
        first = dispatcher(store, webhook(tmp_path, mes, topics=("calibration.applied",)))
        await first.start()
        await first.stop()
        await apply_some(store, "while nobody sends")
        assert await pending_counts(store) == {"mes": 2}
        await store.close()
        store = Store(tmp_path)
        second = dispatcher(store, webhook(tmp_path, mes, topics=("calibration.applied",)))
        await second.start()
        (told,) = await mes.has(1)
        assert told["data"]["calibration_id"] == "while nobody sends"
        await second.stop()
        await store.close()


async def test_a_daemon_whose_secret_is_missing_does_not_start_and_says_why(tmp_path: Path) -> None:
    """What its start raises reaches whoever started it: not a traceback in the log, and no daemon."""
    hook = WebhookSettings(receiver="mes", url="http://127.0.0.1:1/", secret_file=str(tmp_path / "secret"))
    with pytest.raises(SecretUnusable, match="no such file or directory: make one"):
        async with serving(settings_for(tmp_path).model_copy(update={"webhooks": (hook,)})):
            pytest.fail("it serves")


async def test_a_run_and_a_view_are_reported_by_the_running_daemon(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(SECRET)
    async with receiving() as mes:
        hook = {"receiver": "mes", "url": mes.url, "secret_file": str(tmp_path / "secret")}
        settings = settings_for(tmp_path)
        settings = settings.model_copy(update={"webhooks": (WebhookSettings.model_validate(hook),)})
        async with serving(settings) as bench:
            run = (await bench.client.post("/scans?wait=200", json={"capture": True, "poses": None})).json()
            assert run["code"] == "no-poses"
            done = (await bench.client.post("/calibrate?wait=200")).json()
            bodies = await mes.has(2)
            assert {body["type"] for body in bodies} == {"calibration.stored", "run.ended"}
            ended = next(body["data"] for body in bodies if body["type"] == "run.ended")
            assert (ended["run_id"], ended["state"]) == (done["id"], "finished")
