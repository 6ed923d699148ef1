"""Requests that are refused before anything looks at their body, and strangers who leave no trace."""

import asyncio
import logging
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from daemon.access.keys import new_key
from daemon.access.roles import Role
from daemon.runtime.logs import INTERVAL_S, MAX_SUBJECTS, LogLimit
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.support.waiting import LIMIT_S, eventually


async def asked(bench: Bench, *lines: str) -> str:
    """Status and code of the answer to a head of these lines; no body is sent."""
    url = urlsplit(bench.url)
    reader, writer = await asyncio.open_connection(url.hostname, url.port)
    writer.write("\r\n".join((*lines, "", "")).encode())
    head = (await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)).decode()
    body = await asyncio.wait_for(reader.read(65536), LIMIT_S)
    writer.close()
    code = body.partition(b'"code":"')[2].partition(b'"')[0].decode()
    return f"{head.split()[1]} {code}".strip()


HOST = "Host: localhost"
ASKED = {
    "two hosts": (["POST /scans HTTP/1.1", HOST, "Host: 127.0.0.1", "Content-Length: 0"], "400 request-malformed"),
    "two hosts, one of them ours": (["GET /runs HTTP/1.1", "Host: evil.example", HOST], "400 request-malformed"),
    "two origins": (["POST /scans HTTP/1.1", HOST, "Origin: x", "Origin: x"], "400 request-malformed"),
    "two keys": (["GET /runs HTTP/1.1", HOST, "Authorization: a", "authorization: b"], "400 request-malformed"),
    "two types": (["POST /register HTTP/1.1", HOST, "Content-Type: a/b", "Content-Type: a/b"], "400 request-malformed"),
    "no host": (["GET /health HTTP/1.1"], "421 host-not-allowed"),
    "no host, as HTTP/1.0 allows": (["GET /health HTTP/1.0"], "200"),
    "no host, from a page": (["POST /scans HTTP/1.0", "Origin: x"], "403 cross-origin"),
    "no host, from a page of none": (["POST /scans HTTP/1.0", "Origin: http://"], "403 cross-origin"),
    "gzip": (["POST /scans HTTP/1.1", HOST, "Content-Encoding: gzip", "Content-Length: 9"], "415 unknown-media-type"),
    "gzip twice": (["POST /register HTTP/1.1", HOST, "Content-Encoding: gzip, br"], "415 unknown-media-type"),
    "as it is": (["GET /health HTTP/1.1", HOST, "Content-Encoding: identity"], "200"),
}  # fmt: skip


async def test_heads_that_two_readers_might_read_in_two_ways_are_refused(bench: Bench) -> None:
    answers = {case: await asked(bench, *lines) for case, (lines, _) in ASKED.items()}
    assert answers == {case: expected for case, (_, expected) in ASKED.items()}
    assert await bench.application.store.listings.scans(10) == []


async def test_the_set_up_refuses_before_it_reads_the_body_when_there_are_keys(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        await bench.application.key_service.add("admin", Role.ADMIN, TEST)
        lines = ("POST /setup HTTP/1.1", HOST, "Content-Length: 500")
        assert await asked(bench, *lines) == "403 setup-refused"
        assert await asked(bench, *lines, "Idempotency-Key: k") == "403 setup-refused"


@pytest.mark.parametrize("path", ["/setup", "/calibrate", "/register?pose=1,2,3,1,0,0,0", "/scans"])
@pytest.mark.parametrize("named", [False, True], ids=["", "with an Idempotency-Key"])
async def test_a_client_that_leaves_within_its_body_is_no_error(
    bench: Bench, path: str, named: bool, caplog: pytest.LogCaptureFixture
) -> None:
    url = urlsplit(bench.url)
    header = "Idempotency-Key: k\r\nContent-Type: application/octet-stream\r\n" if named else ""
    for length in ("Content-Length: 900\r\n\r\n{", "Transfer-Encoding: chunked\r\n\r\n1\r\n{\r\n"):
        _, writer = await asyncio.open_connection(url.hostname, url.port)
        writer.write(f"POST {path} HTTP/1.1\r\n{HOST}\r\n{header}{length}".encode())
        await eventually(lambda: bool(bench.server.server_state.connections))
        writer.transport.abort()
        await eventually(lambda: not bench.server.server_state.connections and not bench.server.server_state.tasks)
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING] == []
    assert not any(status >= 500 for _, status in bench.application.metrics.requests)


async def test_guessed_keys_fill_no_log(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        await bench.application.key_service.add("admin", Role.ADMIN, TEST)
        for k in range(50):
            guess = new_key(lambda n, k=k: f"{k:02x}" * n)[0]  # type: ignore[misc]
            assert (await bench.client.get("/runs", headers=bearer(guess))).status_code == 401
    assert caplog.text.count("is refused") == 1


def test_one_line_a_minute_and_subject_with_the_number_of_those_left_out() -> None:
    now_s = [0.0]
    limit = LogLimit(lambda: now_s[0])
    assert [limit.left_out("a") for _ in range(4)] == [0, None, None, None]
    assert limit.left_out("b") == 0
    now_s[0] += INTERVAL_S
    assert (limit.left_out("a"), limit.left_out("b")) == (3, 0)


def test_many_subjects_share_one_line() -> None:
    now_s = [0.0]
    limit = LogLimit(lambda: now_s[0])
    lines = [limit.left_out(f"{k}") for k in range(10 * MAX_SUBJECTS)]
    assert lines.count(0) == MAX_SUBJECTS + 1
    now_s[0] += INTERVAL_S
    assert limit.left_out("another") == 0
