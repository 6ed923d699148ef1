"""A browser signs in with a key or a pairing code; the session ends with its key, and no other page can use it."""

import asyncio
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from daemon.access.browser_sessions import MAX_SESSION_S, cookie_of, token_in
from daemon.access.pairing import MAX_ATTEMPTS, MAX_GUESSES, MAX_PAIRING_S, PairingCodes
from daemon.access.roles import Role
from daemon.runtime.clock import Clock
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.api.raw_requests import RawRequest
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.fakes import Gate
from tests.support.waiting import LIMIT_S

TOKEN = "a" * 43


@dataclass
class Browser:
    """A browser with the cookie of a session, which states its origin as browsers do."""

    bench: Bench
    cookie: str

    async def ask(self, method: str, path: str, headers: dict[str, str] | None = None, **body: Any) -> httpx.Response:
        own = {"origin": self.bench.url, "sec-fetch-site": "same-origin", "cookie": self.cookie}
        return await self.bench.client.request(method, path, headers=own | (headers or {}), **body)


async def key_of(bench: Bench, name: str, role: Role) -> str:
    return (await bench.application.key_service.add(name, role, TEST))[0]


async def sign_in(bench: Bench, **credential: str) -> Browser:
    answer = await bench.client.post("/session", json=credential)
    bench.client.cookies.clear()
    assert answer.status_code == 201, answer.text
    return Browser(bench, answer.headers["set-cookie"].partition(";")[0])


async def test_a_key_is_exchanged_for_a_cookie_that_scripts_and_other_sites_do_not_get(
    bench: Bench, tmp_path: Path
) -> None:
    key = await key_of(bench, "Ann", Role.OPERATOR)
    answer = await bench.client.post("/session", json={"key": key})
    assert (answer.status_code, answer.json()["name"], answer.json()["role"]) == (201, "Ann", "operator")
    cookie, *attributes = answer.headers["set-cookie"].split("; ")
    assert sorted(attributes) == ["HttpOnly", f"Max-Age={MAX_SESSION_S}", "Path=/", "SameSite=Strict"]
    assert cookie.startswith("handeyed=")
    assert key not in answer.text + answer.headers["set-cookie"]
    files = (file for file in tmp_path.rglob("*") if file.is_file())  # noqa: ASYNC240
    assert cookie.partition("=")[2].encode() not in b"".join(file.read_bytes() for file in files)


@pytest.mark.parametrize(("scheme", "start"), [("https", "__Host-handeyed="), ("http", "handeyed=")])
def test_the_cookie_over_tls_is_bound_to_this_host(scheme: str, start: str) -> None:
    cookie = cookie_of(scheme, TOKEN, 1)
    assert cookie.startswith(start)
    assert ("; Secure" in cookie) == (scheme == "https")
    assert "Domain" not in cookie
    assert token_in(cookie.partition(";")[0], scheme) == TOKEN
    assert token_in(cookie.partition(";")[0], "http" if scheme == "https" else "https") is None


async def test_who_is_signed_in_and_what_is_asked(bench: Bench, tmp_path: Path) -> None:
    before = (await bench.client.get("/session")).json()
    assert (before["asked"], before["role"]) == ("nobody", "admin")
    key = await key_of(bench, "Ann", Role.VIEWER)
    stranger = (await bench.client.get("/session")).json()
    assert (stranger["asked"], stranger["role"], stranger["name"]) == ("key", "nobody", "")
    assert stranger["last_event_id"] is None
    signed_in = (await (await sign_in(bench, key=key)).ask("GET", "/session")).json()
    assert (signed_in["name"], signed_in["role"]) == ("Ann", "viewer")
    assert signed_in["expires_at"] > bench.application.clock.timestamp()
    bench.application.events.publish("run", {})
    await bench.application.events.flush()
    again = (await (await sign_in(bench, key=key)).ask("GET", "/session")).json()
    assert again["last_event_id"] == bench.application.events.last > signed_in["last_event_id"]


CSRF: dict[str, tuple[dict[str, str], int]] = {
    "own page": ({"origin": "own"}, 201),
    "own page that hides its origin": ({"sec-fetch-site": "same-origin"}, 201),
    "a page of another origin": ({"origin": "https://evil.example"}, 403),
    "a sandboxed frame": ({"origin": "null"}, 403),
    "another site without an origin": ({"sec-fetch-site": "cross-site"}, 403),
    "another port of this machine": ({"sec-fetch-site": "same-site"}, 403),
    "typed into the address bar": ({"sec-fetch-site": "none"}, 403),
    "neither": ({}, 403),
}


@pytest.mark.parametrize(("headers", "expected"), CSRF.values(), ids=CSRF)
async def test_a_cookie_changes_something_for_pages_of_this_daemon_only(
    bench: Bench, headers: dict[str, str], expected: int
) -> None:
    browser = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
    stated = {name: bench.url if value == "own" else value for name, value in headers.items()}
    answer = await bench.client.post("/scans", headers={"cookie": browser.cookie, **stated})
    assert answer.status_code == expected, answer.text
    if expected == 403:
        assert answer.json()["code"] == "cross-origin"
    ended = await bench.client.delete("/session", headers={"cookie": browser.cookie, **stated})
    assert ended.status_code == (204 if expected == 201 else 403)


async def test_signing_out_ends_the_session_and_its_stream_but_no_other(bench: Bench) -> None:
    key = await key_of(bench, "Ann", Role.VIEWER)
    first, second = await sign_in(bench, key=key), await sign_in(bench, key=key)
    stream = await RawRequest.send(bench, f"GET /live\nCookie: {first.cookie}\nConnection: close")
    assert b" 200 " in await stream.reader.readline()
    out = await first.ask("DELETE", "/session")
    assert (out.status_code, "Max-Age=0" in out.headers["set-cookie"]) == (204, True)
    async with asyncio.timeout(LIMIT_S):
        assert (await stream.reader.read()).endswith(b"0\r\n\r\n")
    await stream.hang_up()
    assert (await first.ask("GET", "/runs")).json()["code"] == "key-missing"
    assert (await second.ask("GET", "/runs")).status_code == 200
    assert (await first.ask("DELETE", "/session")).status_code == 204


@pytest.mark.parametrize("path", ["/live", "/events", "/camera/stream"])
async def test_a_session_and_its_streams_end_with_the_key(bench: Bench, path: str) -> None:
    browser = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
    stream = await RawRequest.send(bench, f"GET {path}\nCookie: {browser.cookie}\nConnection: close")
    assert b" 200 " in await stream.reader.readline()
    await bench.application.key_service.revoke("Ann", TEST)
    async with asyncio.timeout(LIMIT_S):
        assert (await stream.reader.read()).endswith(b"0\r\n\r\n")
    await stream.hang_up()
    assert (await browser.ask("GET", "/robot")).status_code == 401
    assert (await browser.ask("GET", "/session")).json()["role"] == "nobody"


async def test_a_session_never_outlives_its_key_or_twelve_hours(tmp_path: Path) -> None:
    now = [datetime.now(UTC)]
    clock = Clock(utc_now=lambda: now[0])
    async with serving(settings_for(tmp_path)) as bench:
        desk, sign = bench.application.key_service, bench.application.sign_in
        sign.clock = clock
        short = (await desk.add("short", Role.VIEWER, TEST, days=0.25))[0]
        endless = (await desk.add("endless", Role.VIEWER, TEST, days=None))[0]
        _, session, record = await sign.with_key(short, "::1", "::1")
        assert session.expires_at == record.expires_at
        token, session, _ = await sign.with_key(endless, "::1", "::1")
        assert (await sign.find(token))[0] == session
        now[0] += timedelta(seconds=MAX_SESSION_S)
        with pytest.raises(Exception, match="this session has ended"):
            await sign.find(token)


async def test_attempts_to_sign_in_are_few(bench: Bench) -> None:
    await key_of(bench, "Ann", Role.VIEWER)
    answers = [await bench.client.post("/session", json={"key": "let me in"}) for _ in range(MAX_ATTEMPTS + 1)]
    assert [answer.status_code for answer in answers] == [401] * MAX_ATTEMPTS + [429]
    assert answers[-1].json()["code"] == "too-many-attempts"
    assert "retry-after" in answers[-1].headers


@pytest.mark.parametrize("body", [{}, {"key": "a", "code": "b"}, {"key": ""}, {"key": "x" * 2000}, {"password": "a"}])
async def test_a_body_that_is_not_one_credential_is_refused(bench: Bench, body: dict[str, str]) -> None:
    assert (await bench.client.post("/session", json=body)).status_code in (413, 422)


async def test_a_signed_in_screen_signs_another_one_in_once(bench: Bench) -> None:
    ann = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
    pairing = await ann.ask("POST", "/session/pairing", json={"role": "viewer"})
    assert (pairing.status_code, pairing.json()["role"]) == (201, "viewer")
    code = pairing.json()["code"].lower().replace("-", " ")
    tablet = await sign_in(bench, code=code)
    assert (await tablet.ask("GET", "/session")).json()["role"] == "viewer"
    assert (await tablet.ask("POST", "/scans")).json()["code"] == "role-too-low"
    again = await bench.client.post("/session", json={"code": code})
    assert (again.status_code, again.json()["code"]) == (403, "pairing-refused")
    assert (await ann.ask("POST", "/session/pairing", json={"role": "admin"})).json()["code"] == "role-too-low"
    await bench.application.key_service.revoke("Ann", TEST)
    assert (await tablet.ask("GET", "/runs")).status_code == 401


async def pairs(browser: Browser) -> Browser:
    code = (await browser.ask("POST", "/session/pairing", json={})).json()["code"]
    return await sign_in(browser.bench, code=code)


async def test_a_chain_of_paired_sessions_ends_with_the_first(bench: Bench) -> None:
    key = await key_of(bench, "Ann", Role.OPERATOR)
    other, first = await sign_in(bench, key=key), await sign_in(bench, key=key)
    second = await pairs(first)
    third = await pairs(second)
    stream = await RawRequest.send(bench, f"GET /live\nCookie: {third.cookie}\nConnection: close")
    assert b" 200 " in await stream.reader.readline()
    open_code = (await first.ask("POST", "/session/pairing", json={})).json()["code"]
    await first.ask("DELETE", "/session")
    async with asyncio.timeout(LIMIT_S):
        assert (await stream.reader.read()).endswith(b"0\r\n\r\n")
    await stream.hang_up()
    asked = [(await each.ask("GET", "/runs")).status_code for each in (first, second, third, other)]
    assert asked == [401, 401, 401, 200]
    refused = await bench.client.post("/session", json={"code": open_code})
    assert (refused.status_code, refused.json()["code"]) == (403, "pairing-refused")
    admin = await key_of(bench, "admin", Role.ADMIN)
    rows = (await bench.client.get("/audit", headers=bearer(admin))).json()["rows"]
    assert [row["action"] for row in rows].count("session ended") == 3


async def test_a_paired_session_ends_no_later_than_its_parent(tmp_path: Path) -> None:
    now = [datetime.now(UTC)]
    async with serving(settings_for(tmp_path)) as bench:
        sign = bench.application.sign_in
        sign.clock = Clock(utc_now=lambda: now[0])
        first = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
        ends = (await first.ask("GET", "/session")).json()["expires_at"]
        last = first
        for _ in range(3):
            now[0] += timedelta(minutes=14)
            last = await pairs(last)
            assert (await last.ask("GET", "/session")).json()["expires_at"] == ends


async def test_without_keys_there_is_nothing_to_pair(bench: Bench) -> None:
    assert (await bench.client.post("/session/pairing")).json()["code"] == "pairing-refused"


def test_a_few_wrong_codes_or_five_minutes_end_a_pairing_code() -> None:
    now = [0.0]
    codes = PairingCodes(lambda letters: letters[0], lambda: now[0])
    code = codes.begin("k", Role.VIEWER)
    assert code == "2222-2222"
    assert [codes.redeem(f"{n}") for n in range(MAX_GUESSES)] == [None] * MAX_GUESSES
    assert codes.redeem(code) is None
    code = codes.begin("k", Role.VIEWER)
    now[0] = MAX_PAIRING_S
    assert codes.redeem(code) is None
    code = codes.begin("k", Role.VIEWER)
    found = codes.redeem(code)
    assert found is not None
    assert found.key_id == "k"
    assert codes.redeem(code) is None


async def test_an_idle_session_only_reads_and_aborts(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        sign = bench.application.sign_in
        browser = await sign_in(bench, key=await key_of(bench, "Ann", Role.ADMIN))
        bench.robot.before_move = gate = Gate(at_move=2)
        location = (await browser.ask("POST", "/calibrate", json={})).headers["location"]
        await gate.reached.wait()
        idle = datetime.now(UTC) + timedelta(minutes=16)
        sign.clock = Clock(utc_now=lambda: idle)
        assert (await browser.ask("GET", "/session")).json()["role"] == "viewer"
        assert (await browser.ask("GET", "/runs")).status_code == 200
        assert (await browser.ask("POST", "/scans")).json()["code"] == "role-too-low"
        assert (await browser.ask("POST", "/session/touch")).status_code == 204
        sign.clock = Clock(utc_now=lambda: idle + timedelta(seconds=1))
        ended = await browser.ask("POST", f"{location}/abort")
        assert (ended.status_code, ended.json()["state"]) == (200, "aborted")
        gate.open.set()


async def test_a_touch_keeps_the_role(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        browser = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
        for minutes in (10, 20, 30):
            later = datetime.now(UTC) + timedelta(minutes=minutes)
            bench.application.sign_in.clock = Clock(utc_now=lambda later=later: later)  # type: ignore[misc]
            assert (await browser.ask("POST", "/session/touch")).status_code == 204
            assert (await browser.ask("GET", "/session")).json()["role"] == "operator"


async def test_the_audit_log_names_the_session(bench: Bench) -> None:
    admin = await key_of(bench, "admin", Role.ADMIN)
    browser = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
    await browser.ask("POST", "/scans")
    await browser.ask("DELETE", "/session")
    rows = (await bench.client.get("/audit", headers=bearer(admin))).json()["rows"]
    ended, scan, begun = rows[:3]
    assert [row["action"] for row in (ended, scan, begun)] == ["session ended", "scan", "session begun"]
    assert {row["actor"] for row in (ended, scan, begun)} == {f"Ann (session {begun['subject']})"}


async def test_a_run_says_who_started_it(bench: Bench) -> None:
    browser = await sign_in(bench, key=await key_of(bench, "Ann", Role.OPERATOR))
    started = await browser.ask("POST", "/calibrate", params={"wait": LIMIT_S})
    assert (started.json()["started_by"], started.json()["started_by_role"]) == ("Ann", "operator")
    listed = (await browser.ask("GET", "/runs")).json()["runs"][0]
    assert (listed["started_by"], listed["started_by_role"]) == ("Ann", "operator")
