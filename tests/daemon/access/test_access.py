"""Who may do what: every route with every role, from openapi.json; keys as they come, change and go."""

import json
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from daemon.access.errors import KeyExists
from daemon.access.keys import KeyRecord, hash_key, id_of, new_key
from daemon.access.pairing import MAX_SETUP_ATTEMPTS, SetupCode
from daemon.access.roles import ANY, POLICY, ROLES, Role, role_for
from daemon.errors import NotFound
from daemon.model.records import CalibrationRecord
from daemon.runtime.clock import Clock
from daemon.store.access_keys import KeyService
from daemon.store.store import Store
from tests.daemon.access_keys import TEST, bearer, with_keys
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for

OPENAPI = json.loads((Path(__file__).parents[3] / "docs" / "openapi.json").read_text())


NOT_VALID = ("expired", "revoked", "invented", "another secret", "no key at all")

OPERATIONS = [
    (method.upper(), path, Role[operation["x-role"].upper()])
    for path, item in OPENAPI["paths"].items()
    for method, operation in item.items()
]


ENDLESS = ("/events", "/live", "/camera/stream")


@pytest.mark.slow
async def test_every_route_with_every_role_over_a_session(tmp_path: Path) -> None:
    """As with keys: a session has the role of its key, and none of one that is not valid."""
    async with with_keys(tmp_path) as (bench, keys):
        cookies = {}
        for name in ROLES:
            token, _, _ = await bench.application.sign_in.with_key(keys[name], "test", name)
            cookies[name] = f"handeyed={token}"
        token, _, _ = await bench.application.sign_in.with_key(keys["viewer"], "test", "ended")
        await bench.application.sign_in.end(token, TEST)
        cookies |= {"ended": f"handeyed={token}", "invented": f"handeyed={'a' * 43}", "none": "handeyed=let-me-in"}
        for method, path, needed in OPERATIONS:
            place = path.replace("{k}", "0").replace("{", "").replace("}", "")
            if path in ENDLESS or path.startswith(("/session", "/setup")):
                continue
            for name, cookie in cookies.items():
                own = {"origin": bench.url, "cookie": cookie, "content-type": "text/plain"}
                answer = await bench.client.request(method, place, headers=own, content=b"{")
                if needed is Role.NOBODY or (name in ROLES and ROLES[name] >= needed):
                    assert answer.status_code not in (401, 403), (method, path, name, answer.text)
                else:
                    assert answer.status_code == (403 if name in ROLES else 401), (method, path, name)
        assert not bench.robot.goals


@pytest.mark.slow
async def test_every_route_with_every_role(tmp_path: Path) -> None:
    """Bodies that no route takes: what is let in is refused for its body or its path, never for its key."""
    async with with_keys(tmp_path) as (bench, keys):
        for method, path, needed in OPERATIONS:
            place = path.replace("{k}", "0").replace("{", "").replace("}", "")
            if path in ENDLESS or (method, path) == ("POST", "/session"):
                continue  # see below, and test_browser_sessions.py: it takes ten attempts a minute
            for name, key in keys.items():
                answer = await bench.client.request(
                    method, place, headers={**bearer(key), "content-type": "text/plain"}, content=b"{"
                )
                allowed = needed is Role.NOBODY or (name in ROLES and ROLES[name] >= needed)
                expected = None if allowed else 403 if name in ROLES else 401
                if (method, path) == ("POST", "/setup"):
                    assert answer.status_code == 403, (path, name)  # there are keys already
                elif expected is None:
                    assert answer.status_code not in (401, 403), (method, path, name)
                else:
                    assert answer.status_code == expected, (method, path, name)
                    assert answer.headers["content-type"] == "application/problem+json"
                    assert ("www-authenticate" in answer.headers) == (expected == 401)
            bare = await bench.client.request(method, place, content=b"{")
            assert (bare.status_code == 401) == (needed is not Role.NOBODY), (method, path)
        assert not bench.robot.goals


@pytest.mark.parametrize("path", ENDLESS)
async def test_events_need_a_viewer(tmp_path: Path, path: str) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        for name, key in keys.items():
            async with bench.client.stream("GET", path, headers=bearer(key)) as answer:
                assert answer.status_code == (401 if name in NOT_VALID else 200), name


def test_every_operation_of_openapi_says_its_role_and_what_is_unknown_needs_an_operator() -> None:
    assert {needed for _, _, needed in OPERATIONS} == {Role.NOBODY, Role.VIEWER, Role.OPERATOR, Role.ADMIN}
    for method in ("POST", "PUT", "PATCH", "DELETE", "TRACE", "INVENTED"):
        assert role_for(method, "/some/new/route") is Role.OPERATOR
    assert role_for("GET", "/some/new/route") is Role.VIEWER
    assert role_for("GET", "/audit") is role_for("GET", "/audit") is Role.ADMIN
    open_to_all = [(method, path) for method, path, needed in OPERATIONS if needed is Role.NOBODY]
    assert sorted(open_to_all) == [
        ("DELETE", "/session"), ("GET", "/health"), ("GET", "/session"), ("POST", "/session"), ("POST", "/setup"),
    ]  # fmt: skip


def test_every_path_of_the_policy_is_a_route() -> None:
    routes = {(method, path) for method, path, _ in OPERATIONS}
    assert {(method, path) for method, path, _ in POLICY if not path.endswith(ANY)} <= routes


@pytest.mark.parametrize("path", ["//audit", "/audit/", "/AUDIT", "/./audit", "/%61udit", "/x/../audit"])
async def test_a_path_written_otherwise_opens_nothing(tmp_path: Path, path: str) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        answer = await bench.client.get(httpx.URL(bench.url).copy_with(raw_path=path.encode()),
                                        headers=bearer(keys["viewer"]))  # fmt: skip
        assert answer.status_code in (403, 404), answer.text
        assert "rows" not in answer.text


async def test_on_this_machine_nobody_is_asked_until_there_is_a_key(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        assert (await bench.client.get("/audit")).status_code == 200
        key, _ = await bench.application.key_service.add("Ann", Role.ADMIN, TEST)
        assert (await bench.client.get("/audit")).json()["code"] == "key-missing"
        assert (await bench.client.get("/audit", headers=bearer(key))).status_code == 200
        await bench.application.key_service.revoke("Ann", TEST)
        assert (await bench.client.get("/audit")).status_code == 401  # once required, always required
    async with serving(settings_for(tmp_path)) as bench:
        assert (await bench.client.get("/runs")).status_code == 401


async def test_the_set_up_code_makes_one_admin_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    async with serving(settings_for(tmp_path)) as bench:
        code = bench.application.key_service.code.text
        assert code in caplog.text
        wrong = await bench.client.post("/setup", json={"code": "ABCD", "name": "Eve"})
        assert (wrong.status_code, wrong.json()["code"]) == (403, "setup-refused")
        made = await bench.client.post("/setup", json={"code": code.lower().replace("-", " "), "name": "Ann"})
        assert (made.status_code, made.json()["role"]) == (201, "admin")
        assert (await bench.client.get("/audit", headers=bearer(made.json()["key"]))).status_code == 200
        again = await bench.client.post("/setup", json={"code": code, "name": "Eve"})
        assert (again.status_code, again.json()["code"]) == (403, "setup-refused")
        assert made.json()["key"] not in caplog.text
    assert files_with(tmp_path, made.json()["key"]) == []
    caplog.clear()
    async with serving(settings_for(tmp_path)) as bench:
        assert bench.application.key_service.code.text not in caplog.text


def files_with(folder: Path, text: str) -> list[Path]:
    return [file for file in folder.rglob("*") if file.is_file() and text.encode() in file.read_bytes()]


async def test_the_key_from_the_set_up_is_not_kept_by_an_idempotency_key_either(bench: Bench) -> None:
    body = {"code": bench.application.key_service.code.text, "name": "Ann"}
    made = await bench.client.post("/setup", json=body, headers={"idempotency-key": "k"})
    again = await bench.client.post("/setup", json=body, headers={"idempotency-key": "k"})
    assert (made.status_code, again.status_code) == (201, 403)


def test_a_few_wrong_guesses_end_the_code() -> None:
    code = SetupCode(lambda letters: letters[0])
    assert code.text == "2222-2222-2222-2222"
    assert not any(code.redeem(f"{k}") for k in range(MAX_SETUP_ATTEMPTS))
    assert not code.redeem(code.text)


@pytest.fixture
async def store(tmp_path: Path) -> AsyncIterator[Store]:
    store = Store(tmp_path)
    yield store
    await store.close()


async def test_a_rotated_key_leaves_time_to_bring_the_new_one_round(store: Store) -> None:
    now = [datetime(2026, 11, 21, 9, tzinfo=UTC)]
    desk = KeyService(store.access_keys, Clock(utc_now=lambda: now[0]))
    old, _ = await desk.add("MES", Role.OPERATOR, TEST)
    new, record = await desk.rotate("MES", TEST, overlap_h=24)
    assert (record.name, record.role) == ("MES", "operator")

    async def valid(key: str) -> bool:
        found = await store.access_keys.find(key)
        return found is not None and found.valid(desk.clock.timestamp())

    assert (await valid(old), await valid(new)) == (True, True)
    now[0] += timedelta(hours=24)
    assert (await valid(old), await valid(new)) == (False, True)
    now[0] += timedelta(days=365)
    assert (await valid(old), await valid(new)) == (False, False)
    with pytest.raises(NotFound):
        await desk.rotate("MES", TEST)


async def test_names_are_unique_among_valid_keys(store: Store) -> None:
    desk = KeyService(store.access_keys, Clock())
    await desk.add("MES", Role.OPERATOR, TEST)
    with pytest.raises(KeyExists):
        await desk.add("MES", Role.ADMIN, TEST)
    await desk.revoke("MES", TEST)
    await desk.add("MES", Role.VIEWER, TEST)
    with pytest.raises(NotFound):
        await desk.revoke("nobody", TEST)


@pytest.mark.parametrize("other", ["ann muller", "Ann Müller", "ANN MÜLLER", "Ann-Mu11er"])
async def test_two_valid_keys_have_no_names_that_look_alike(store: Store, other: str) -> None:
    desk = KeyService(store.access_keys, Clock())
    await desk.add("Ann Müller", Role.OPERATOR, TEST)
    with pytest.raises(KeyExists):
        await desk.add(other, Role.ADMIN, TEST)


def test_a_key_has_256_bits_and_is_stored_as_its_hash() -> None:
    asked: list[int] = []

    def random_hex(count: int) -> str:
        asked.append(count)
        return "0f" * count

    key, key_id, key_hash = new_key(random_hex)
    assert asked[1] * 8 == 256
    assert key == f"hek_{key_id}_{'0f' * 32}"
    assert key_hash == hash_key(key)
    assert "0f0f" not in key_hash
    assert [id_of(text) for text in (key, key.upper(), key + "0", "", "hek__")] == [key_id, None, None, None, None]


def test_what_a_key_is_at_a_time() -> None:
    record = KeyRecord("i", "n", "viewer", "h", "2026-01-01T00:00:00.000Z", "2026-06-01T00:00:00.000Z")
    assert record.state("2026-05-31T23:59:59.999Z") == "valid"
    assert record.state("2026-06-01T00:00:00.000Z") == "expired"
    assert replace(record, revoked_at="2026-02-01T00:00:00.000Z").state("2026-03-01T00:00:00.000Z") == "revoked"


async def test_a_verdict_is_overruled_by_an_admin_only_and_nobody_applies_in_anothers_name(tmp_path: Path) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        for name, accepted in (("good", True), ("bad", False)):
            document = a_calibration(name, accepted=accepted)
            record = CalibrationRecord(name, None, document.created_at, accepted, document)
            await bench.application.store.save_calibration(record)

        async def applies(role: str, which: str, **body: Any) -> httpx.Response:
            return await bench.client.post(f"/calibrations/{which}/apply", json=body, headers=bearer(keys[role]))

        assert (await applies("operator", "good")).json()["applied_by"] == "operator"
        assert (await applies("operator", "good", applied_by="admin")).json()["applied_by"] == "admin (operator)"
        assert (await applies("operator", "bad", despite_verdict=True)).json()["code"] == "role-too-low"
        assert (await applies("admin", "bad", despite_verdict=True)).status_code == 200


async def test_an_idempotency_key_belongs_to_its_caller(tmp_path: Path) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        scans = [
            (await bench.client.post("/scans", headers={**bearer(keys[role]), "idempotency-key": "k"})).json()["id"]
            for role in ("operator", "admin", "operator")
        ]
        assert scans[0] == scans[2] != scans[1]
