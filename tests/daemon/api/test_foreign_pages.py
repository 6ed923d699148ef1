"""A page of another origin, in a browser on the cell's PC, reads, starts and triggers nothing."""

import json
from pathlib import Path

import pytest

from daemon.api.middleware.request_checks import LINKED_PATHS
from tests.daemon.cell_under_test import Bench

OPENAPI = json.loads((Path(__file__).parents[3] / "docs" / "openapi.json").read_text())
OPERATIONS = [
    (method.upper(), path.replace("{k}", "0").replace("{", "").replace("}", ""))
    for path, item in OPENAPI["paths"].items()
    for method in item
]

LINK = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
"""What a browser sends when a link is followed in a window of its own."""

FOREIGN_PAGES: dict[str, dict[str, str]] = {
    "fetch": {"origin": "https://evil.example", "sec-fetch-site": "cross-site", "sec-fetch-mode": "cors"},
    "no-cors fetch, image": {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors", "sec-fetch-dest": "image"},
    "another port of this machine": {"sec-fetch-site": "same-site", "sec-fetch-mode": "no-cors"},
    "the same in an old browser": {"origin": "http://127.0.0.1:1"},
    "sandboxed frame": {"origin": "null"},
    "frame": {**LINK, "sec-fetch-dest": "iframe"},
    "form": {**LINK, "origin": "https://evil.example"},
    "its own host in the origin's path": {"origin": "https://evil.example/http://localhost"},
    "no host": {"origin": "http://"},
    "an unknown site": {"sec-fetch-site": "elsewhere"},
}

LINKED = {
    "/", "/health", "/openapi.json", "/runs", "/runs/run_id", "/calibrations", "/calibrations/current",
    "/calibrations/calibration_id", "/scans", "/scans/scan_id",
}  # fmt: skip


def device_requests(bench: Bench) -> int:
    return bench.robot.requests + bench.camera.pictures + bench.scanner.scans


@pytest.mark.parametrize("headers", FOREIGN_PAGES.values(), ids=FOREIGN_PAGES)
async def test_no_route_answers_a_page_of_another_origin(bench: Bench, headers: dict[str, str]) -> None:
    before = device_requests(bench)
    for method, path in OPERATIONS:
        answer = await bench.client.request(method, path, headers={"host": "localhost", **headers})
        assert (answer.status_code, answer.json()["code"]) == (403, "cross-origin"), (method, path)
        assert "access-control-allow-origin" not in answer.headers
    assert device_requests(bench) == before


async def test_a_link_on_a_foreign_page_leads_to_documents_that_work_no_device(bench: Bench) -> None:
    before = device_requests(bench)
    answered = set()
    for method, path in OPERATIONS:
        answer = await bench.client.request(method, path, headers=LINK)
        if answer.status_code != 403:
            assert method == "GET"
            answered.add(path)
    assert answered == LINKED - {"/openapi.json"}  # FastAPI serves it beside the table of routes
    assert (await bench.client.get("/openapi.json", headers=LINK)).status_code == 200
    assert device_requests(bench) == before


@pytest.mark.parametrize(
    "path", ["/robot", "/ready", "//", "/runs/x/frames/0", "/runs/..%2f..%2frobot/y", "/scans/x/cloud"]
)
def test_links_lead_nowhere_else(path: str) -> None:
    assert LINKED_PATHS.fullmatch(path) is None


@pytest.mark.parametrize("headers", [{}, {"sec-fetch-site": "none"}, {"sec-fetch-site": "same-origin"}])
async def test_programs_and_pages_of_the_daemon_are_answered(bench: Bench, headers: dict[str, str]) -> None:
    own = {"origin": bench.url} if headers else {}
    assert (await bench.client.get("/robot", headers={**headers, **own})).status_code == 200


async def test_an_origin_needs_a_host_to_compare_with(bench: Bench) -> None:
    import asyncio

    _, _, address = bench.url.rpartition("/")
    host, port = address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(b"POST /scans HTTP/1.0\r\nOrigin: x\r\n\r\n")
    assert b" 403 " in await reader.readline()
    writer.close()
