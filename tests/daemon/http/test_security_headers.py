"""Every answer has the headers that keep a browser from using it in other ways than the daemon's page."""

import asyncio
import json
import re
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from daemon.http.security_headers import CONTENT_SECURITY_POLICY, SECURITY_HEADERS, with_security_headers
from tests.daemon.cell_under_test import Bench

OPENAPI = json.loads((Path(__file__).parents[3] / "docs" / "openapi.json").read_text())
ENDLESS = ("/events", "/live", "/camera/stream")
WANTED = {name.decode(): value.decode() for name, value in SECURITY_HEADERS.items() if name != b"cache-control"}


def test_the_policy_allows_nothing_unsafe_and_nothing_from_elsewhere() -> None:
    directives = dict(part.strip().split(" ", 1) for part in CONTENT_SECURITY_POLICY.split(";"))
    assert "unsafe" not in CONTENT_SECURITY_POLICY
    assert not re.search(r"https?:|\*|data:", CONTENT_SECURITY_POLICY)
    assert directives["default-src"] == directives["frame-ancestors"] == "'none'"
    assert directives["trusted-types"] == "graphics-worker", "gives one address, see daemon/page/scene/graphics.js"
    assert directives["require-trusted-types-for"] == "'script'"


async def test_every_route_sends_them_whatever_it_answers(bench: Bench) -> None:
    for path, item in OPENAPI["paths"].items():
        place = path.replace("{k}", "0").replace("{", "").replace("}", "")
        if path in ENDLESS:
            continue
        for method in item:
            answer = await bench.client.request(method, place, headers={"content-type": "text/plain"}, content=b"{")
            assert {name: answer.headers.get(name) for name in WANTED} == WANTED, (method, path)
            assert "no-store" in answer.headers["cache-control"] or "immutable" in answer.headers["cache-control"]


@pytest.mark.parametrize("path", ENDLESS)
async def test_streams_send_them(bench: Bench, path: str) -> None:
    async with bench.client.stream("GET", path) as answer:
        assert {name: answer.headers.get(name) for name in WANTED} == WANTED
        assert answer.headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    "request_bytes",
    [b"nonsense\r\n\r\n", b"GET / HTTP/1.1\r\nHost: a.example\r\n\r\n", b"GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n"],
    ids=["not HTTP", "another host", "no page"],
)  # fmt: skip
async def test_refusals_of_the_server_send_them(bench: Bench, request_bytes: bytes) -> None:
    url = urlsplit(bench.url)
    reader, writer = await asyncio.open_connection(url.hostname, url.port)
    writer.write(request_bytes)
    head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
    writer.close()
    for name, value in WANTED.items():
        assert f"\r\n{name}: {value.lower()}\r\n" in head


def test_an_answer_keeps_its_own() -> None:
    headers = dict(with_security_headers([(b"Cache-Control", b"private, immutable")]))
    assert headers[b"Cache-Control"] == b"private, immutable"
    assert b"cache-control" not in headers
