"""Names made to do harm: they lead nowhere, fill nothing and colour nobody's terminal."""

import json
import logging
from pathlib import Path

import httpx
import pytest

from daemon.access.roles import Role
from daemon.runtime.logs import OneLineFormatter
from daemon.store.actor import AuditContext
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.records import names_in

OPENAPI = json.loads((Path(__file__).parents[3] / "docs" / "openapi.json").read_text())
PATHS = [
    (method.upper(), path)
    for path, item in OPENAPI["paths"].items()
    for method in item
    if "{" in path
]  # fmt: skip

HOSTILE = [
    "..", ".", "../..", "..%2f..%2fetc%2fpasswd", "%2e%2e%2fhandeyed.sqlite", "..%5c..%5c", "%00", "a%00b", "CON",
    "%0d%0aSet-Cookie:x", "~", "%2fetc%2fpasswd", "x" * 65, "x" * 5000, "%f0%9f%92%a3", "' OR 1=1 --", "%1b[31m", "*",
]  # fmt: skip


@pytest.mark.slow
async def test_an_identifier_leads_nowhere_but_to_what_the_store_knows(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("SECRET")
    async with serving(settings_for(tmp_path / "store")) as bench:
        await apply_calibration(bench)
        for method, path in PATHS:
            for name in HOSTILE:
                answer = await asked(bench, method, _filled(path, name.replace(" ", "%20")))
                assert answer.status_code in (400, 404, 405, 415, 422), (path, name, answer.text)
                assert answer.headers["content-type"] == "application/problem+json", (path, name)
                assert "SECRET" not in answer.text
                assert "\r" not in answer.text
        assert not bench.robot.goals
    assert names_in(tmp_path) == ["secret", "store"]


def _filled(path: str, name: str) -> str:
    begin, _, rest = path.partition("{")
    return begin + name + rest.partition("}")[2].replace("{k}", "0")


async def asked(bench: Bench, method: str, raw_path: str) -> httpx.Response:
    """The path as it is written: httpx would tidy it up."""
    url = httpx.URL(bench.url)
    request = bench.client.build_request(method, url)
    request.url = _Raw(url, raw_path.encode())
    return await bench.client.send(request)


class _Raw(httpx.URL):
    """A URL whose path is sent byte for byte."""

    def __init__(self, url: httpx.URL, raw_path: bytes) -> None:
        super().__init__(url)
        self._raw = raw_path

    @property
    def raw_path(self) -> bytes:
        return self._raw


@pytest.mark.parametrize("name", ["a\x1b[31mred", "two\nlines", "\x00", "\x7f", "x" * 201, "\r\nHTTP/1.1 200 OK"])
async def test_names_that_are_kept_hold_no_control_characters_and_have_an_end(bench: Bench, name: str) -> None:
    for path, body in (
        ("/scans", {"name": name}),
        ("/calibrations/x/apply", {"applied_by": name}),
        ("/setup", {"code": "x", "name": name}),
    ):
        answer = await bench.client.post(path, json=body)
        assert answer.status_code == 422, (path, answer.text)
        assert "\x1b" not in answer.text
    assert (await bench.client.get("/scans")).json()["scans"] == []


async def test_what_a_request_says_stays_on_its_line_of_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    async with serving(settings_for(tmp_path)) as bench:
        await bench.application.key_service.add("x", Role.VIEWER, AuditContext())
        await asked(bench, "GET", "/runs/%1b[31m%0aERROR%20forged%20line%e2%80%ae")
    lines = [OneLineFormatter().format(record) for record in caplog.records]
    assert any("forged line" in line for line in lines)
    for line in lines:
        assert line.isprintable()
