"""The interface's manners: every refusal is a problem with code and fix, and openapi.json is what is served."""

import asyncio
import inspect
import json
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import jsonschema_rs
import pytest
from fastapi.routing import APIRoute

from daemon.api.app import routes
from daemon.api.dependencies import NAMES
from daemon.api.middleware.request_checks import MAX_JSON_BYTES
from daemon.api.negotiation import wants_text
from daemon.api.route_table import routers
from daemon.http.problem_details import reason_phrase
from daemon.model.records import CalibrationRecord
from extensions.installed import INSTALLED
from tests.daemon.api.event_stream import read_events
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench, pose_json, serving, settings_for
from tests.daemon.fakes import poses_around_the_target
from tests.support.waiting import LIMIT_S

OPENAPI = Path(__file__).parents[3] / "docs" / "openapi.json"
HERE = "regenerate it: python -m tests.daemon.openapi_file"


def test_the_committed_openapi_is_what_is_served() -> None:
    assert json.loads(OPENAPI.read_text()) == json.loads(json.dumps(routes(None, INSTALLED).openapi())), HERE


async def test_openapi_is_made_when_it_is_asked_for_and_once(bench: Bench) -> None:
    answers = await asyncio.gather(*[bench.client.get("/openapi.json") for _ in range(3)])
    assert {answer.headers["content-type"] for answer in answers} == {"application/json"}
    (served,) = {answer.content for answer in answers}
    assert json.loads(served) == json.loads(OPENAPI.read_text())


def operations() -> list[tuple[str, str, dict[str, Any]]]:
    document = json.loads(OPENAPI.read_text())
    return [(path, method, spec) for path, item in document["paths"].items() for method, spec in item.items()]


@pytest.mark.parametrize(("path", "method", "spec"), operations())
def test_every_operation_says_what_it_does_and_every_answer_has_a_meaning(
    path: str, method: str, spec: dict[str, Any]
) -> None:
    assert spec.get("description"), (path, method)
    shared = json.loads(OPENAPI.read_text())["components"]["responses"]
    for status, given in spec["responses"].items():
        answer = shared[given["$ref"].rpartition("/")[2]] if "$ref" in given else given
        assert answer["description"], (path, method, status)
        if status.isdigit() and int(status) >= 400 and path != "/ready":
            assert list(answer["content"]) == ["application/problem+json"]


def test_every_operation_has_the_name_that_a_generated_client_calls() -> None:
    named = {f"{method.upper()} {path}": spec["operationId"] for path, method, spec in operations()}
    added = {
        f"{method} {route.path}": route.operation_id
        for extension in INSTALLED
        for router in extension.routers
        for route in router.routes
        if isinstance(route, APIRoute)
        for method in route.methods
    }
    assert named == NAMES | added
    assert len(set(named.values())) == len(named)


def test_no_dependency_waits_for_a_thread() -> None:
    """FastAPI calls those that are not asynchronous in its thread pool, which readers may fill."""
    asked = [r.dependant for router in routers(INSTALLED) for r in router.routes if isinstance(r, APIRoute)]
    assert asked
    for dependant in asked:
        for inner in dependant.dependencies:
            asked.append(inner)
            assert inspect.iscoroutinefunction(inner.call) or inspect.iscoroutinefunction(type(inner.call).__call__)


def test_every_reference_in_openapi_leads_somewhere() -> None:
    text = OPENAPI.read_text()
    document = json.loads(text)
    references = {part.split('"')[0] for part in text.split('"$ref": "#/components/')[1:]}
    there = {f"{kind}/{name}" for kind, entries in document["components"].items() for name in entries}
    assert references <= there


def test_every_example_in_openapi_is_what_its_schema_says() -> None:
    document = json.loads(OPENAPI.read_text())
    schemas = document["components"]["schemas"]
    validators = {name: jsonschema_rs.validator_for({**schema, "components": document["components"]})
                  for name, schema in schemas.items()}  # fmt: skip
    shown = 0
    for name, schema in schemas.items():
        for example in schema.get("examples", []):
            validators[name].validate(example)
            shown += 1
    for answer in document["components"]["responses"].values():
        validators["Problem"].validate(answer["content"]["application/problem+json"]["example"])
    assert shown >= 10


async def refused(bench: Bench, method: str, path: str, **request: Any) -> dict[str, Any]:
    """The problem that the request is answered with."""
    answer = await bench.client.request(method, path, **request)
    assert answer.headers["content-type"] == "application/problem+json", answer.text
    problem: dict[str, Any] = answer.json()
    assert problem["status"] == answer.status_code
    assert problem["fix"]
    assert problem["type"] == f"urn:handeyed:problem:{problem['code']}"
    return problem


def pose(**changes: Any) -> dict[str, Any]:
    return {**pose_json(poses_around_the_target(1)[0]), **changes}


TAGS = {"kind": "apriltag-grid", "columns": 5, "rows": 7, "tag_mm": 24, "gap_mm": 8}

BAD_BODIES: list[tuple[bytes, int, str, str]] = [
    (b"{", 400, "body-malformed", "line 1, column 2"),
    (b"\xff\xfe", 400, "body-malformed", "UTF-8"),
    (b"[" * 100_000, 400, "body-malformed", "nests too deep"),
    (b"[]", 422, "document-refused", "document"),
    (b"null", 422, "document-refused", "document"),
    (b'{"cuont": 3}', 422, "document-refused", "cuont"),
    (b'{"count": 2}', 422, "document-refused", "2 is below 3"),
    (b'{"count": NaN}', 422, "document-refused", "count"),
    (b'{"count": 1e999}', 422, "document-refused", "count"),
    (b'{"poses": []}', 422, "document-refused", "of length 0"),
    (json.dumps({"poses": [pose(quaternion_wxyz=[0.9, 0, 0, 0])] * 3}).encode(), 422, "document-refused", "norm 0.9"),
    (
        json.dumps({"poses": [pose(translation_mm=[float("nan"), 0, 0])] * 3}).encode(),
        422,
        "document-refused",
        "poses[0].translation_mm[0]",
    ),
    (b'{"target": {"kind": "cheessboard"}}', 422, "document-refused", "target"),
    (
        json.dumps({"target": {**TAGS, "family": "tag99h9"}}).encode(),
        422,
        "document-refused",
        "the tag family 'tag99h9' is not known",
    ),
]


async def test_a_bad_body_is_reported_and_moves_nothing(bench: Bench) -> None:
    for body, status, code, says in BAD_BODIES:
        problem = await refused(bench, "POST", "/calibrate", content=body)
        assert (problem["status"], problem["code"]) == (status, code), body[:80]
        assert says in problem["detail"], body[:80]
    assert not bench.robot.goals


async def test_a_misspelt_key_is_reported_with_the_nearest_known_one(bench: Bench) -> None:
    problem = await refused(bench, "POST", "/calibrate", json={"cuont": 3})
    assert problem["problems"] == [{"place": "cuont", "what": "unknown key", "fix": "did you mean 'count'?"}]
    problem = await refused(bench, "POST", "/calibrate?wiat=3")
    assert problem["problems"][0]["fix"] == "did you mean 'wait'?"


REFUSED = [
    ("GET", "/nowhere", 404, "no-such-page"),
    ("GET", "/runs/none", 404, "not-found"),
    ("POST", "/runs/none/abort", 404, "not-found"),
    ("GET", "/runs/none/frames/0", 404, "not-found"),
    ("GET", "/runs/%2e%2e%2fhandeyed.sqlite", 404, "no-such-page"),
    ("GET", "/runs/x/frames/-1", 422, "request-refused"),
    ("GET", "/runs/x/frames/one", 422, "request-refused"),
    ("GET", "/runs?limit=0", 422, "request-refused"),
    ("GET", "/runs?limit=NaN", 422, "request-refused"),
    ("GET", "/runs/x?wait=nan", 422, "request-refused"),
    ("GET", "/calibrations/none", 404, "not-found"),
    ("GET", "/calibrations/current", 404, "not-found"),
    ("POST", "/calibrations/none/apply", 404, "not-found"),
    ("GET", "/scans/none", 404, "not-found"),
    ("POST", "/scans/none/views", 404, "not-found"),
    ("POST", "/verify", 409, "no-calibration"),
    ("DELETE", "/calibrate", 405, "method-not-allowed"),
]
ALLOWED = [("/calibrate", "GET, POST"), ("/scans", "GET, POST"), ("/robot", "GET"), ("/register", "POST")]


async def test_what_is_not_there_is_reported(bench: Bench) -> None:
    for method, path, status, code in REFUSED:
        problem = await refused(bench, method, path)
        assert (problem["status"], problem["code"]) == (status, code), path


@pytest.mark.parametrize("path", ["/openapi.json", "/", "/runs", "/calibrations/current"])
async def test_head_is_answered_as_get_without_the_body(bench: Bench, path: str) -> None:
    whole, head = await bench.client.get(path), await bench.client.head(path)
    assert (head.status_code, head.content) == (whole.status_code, b"")
    assert head.headers["content-length"] == whole.headers["content-length"]
    assert head.headers["content-type"] == whole.headers["content-type"]


async def test_405_names_every_method_of_the_path(bench: Bench) -> None:
    for path, allow in ALLOWED:
        answer = await bench.client.put(path)
        assert (answer.status_code, answer.headers["allow"]) == (405, allow)
        assert allow in answer.json()["fix"]


@pytest.mark.parametrize("path", ["/calibrate", "/register?pose=1,2,3,1,0,0,0", "/scans/x/views"])
async def test_a_body_over_the_limit_is_refused_before_it_is_read(tmp_path: Path, path: str) -> None:
    """Only the head is sent: a server that wanted the body first would never answer."""
    async with serving(settings_for(tmp_path, server={"port": 0, "body_limit_mb": 5})) as bench:
        url = urlsplit(bench.url)
        reader, writer = await asyncio.open_connection(url.hostname, url.port)
        writer.write(f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000001\r\n\r\n".encode())
        answer = await asyncio.wait_for(reader.read(), LIMIT_S)
        assert b" 413 " in answer.splitlines()[0]
        assert b"body-too-large" in answer
        writer.close()
        await writer.wait_closed()


async def test_a_body_without_a_length_is_cut_off_at_the_limit(bench: Bench) -> None:
    sent = 0
    url = urlsplit(bench.url)
    reader, writer = await asyncio.open_connection(url.hostname, url.port)
    writer.write(b"POST /calibrate HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n")
    answer = asyncio.create_task(reader.readuntil(b"\r\n\r\n"))
    while not answer.done() and sent < 3 * MAX_JSON_BYTES:
        writer.write(b"10000\r\n" + b" " * 0x10000 + b"\r\n")
        sent += 0x10000
        await asyncio.sleep(0)
    assert b" 413 " in (await asyncio.wait_for(answer, LIMIT_S)).splitlines()[0]
    writer.close()


async def test_a_page_from_elsewhere_cannot_move_the_robot(bench: Bench) -> None:
    problem = await refused(bench, "POST", "/calibrate", headers={"origin": "https://evil.example"})
    assert (problem["status"], problem["code"]) == (403, "cross-origin")
    assert not bench.robot.goals
    own = await bench.client.post("/calibrate", headers={"origin": bench.url})
    assert own.status_code == 202


FOREIGN = ["evil.example", "evil.example:8372", "localhost.evil.example", "127.0.0.1.evil.example", "", "a b", "[::1"]
OWN = ["localhost", "LOCALHOST:1", "127.0.0.1:8372", "[::1]:8372", "192.168.1.7", "cell-7.plant.example"]


async def test_a_name_that_somebody_else_resolves_to_us_is_refused(tmp_path: Path) -> None:
    """DNS rebinding: to the browser the page and the daemon have the same origin then."""
    async with serving(settings_for(tmp_path, server={"allowed_hosts": ["cell-7.plant.example"]})) as bench:
        for host in FOREIGN:
            problem = await refused(bench, "GET", "/health", headers={"host": host})
            assert (problem["status"], problem["code"]) == (421, "host-not-allowed"), host
        for host in OWN:
            assert (await bench.client.get("/health", headers={"host": host})).status_code == 200, host


async def test_a_rejected_calibration_is_applied_only_on_purpose(bench: Bench) -> None:
    for name, accepted, solved in (("good", True, True), ("bad", False, True), ("none", False, False)):
        document = a_calibration(name, accepted=accepted, solved=solved)
        record = CalibrationRecord(name, None, document.created_at, accepted, document)
        await bench.application.store.save_calibration(record)
    problem = await refused(bench, "POST", "/calibrations/bad/apply")
    assert (problem["status"], problem["code"]) == (409, "calibration-unusable")
    assert "the axes are parallel" in problem["detail"]
    assert (await bench.client.post("/calibrations/good/apply", json={"applied_by": "Ann"})).status_code == 200
    assert (await bench.client.get("/calibrations/current")).json()["calibration"]["id"] == "good"
    forced = await bench.client.post("/calibrations/bad/apply", json={"despite_verdict": True})
    assert forced.status_code == 200
    assert (await refused(bench, "POST", "/calibrations/none/apply", json={"despite_verdict": True}))["status"] == 409
    listed = (await bench.client.get("/calibrations")).json()
    assert [row["calibration_id"] for row in listed["applied"]] == ["bad", "good"]
    assert [row["id"] for row in listed["calibrations"] if row["current"]] == ["bad"]


@pytest.mark.parametrize(
    ("accept", "text"),
    [
        (None, False),
        ("*/*", False),
        ("text/plain", True),
        ("text/plain, application/json", False),
        ("text/plain, application/json;q=0.5", True),
        ("application/json, text/plain;q=0.5", False),
        ("text/plain, */*;q=0.1", True),
        ("text/plain;q=0", False),
        ("text/plain;q=nonsense", False),
        ("text/html", False),
    ],
)
def test_json_unless_text_is_preferred(accept: str | None, text: bool) -> None:
    from fastapi import Request

    headers = [] if accept is None else [(b"accept", accept.encode())]
    assert wants_text(Request({"type": "http", "headers": headers})) is text


async def test_metrics_are_prometheus_text(bench: Bench) -> None:
    await bench.client.get("/nowhere")
    await bench.client.post("/calibrate", params={"wait": LIMIT_S})
    page = (await bench.client.get("/metrics")).text
    lines = page.splitlines()
    assert 'handeyed_http_requests_total{method="GET",status="404"} 1' in lines
    assert 'handeyed_device_connected{device="robot"} 1' in lines
    assert any(line.startswith('handeyed_runs_ended_total{kind="calibration",state="finished"} 1') for line in lines)
    families = [line.split()[2] for line in lines if line.startswith("# TYPE")]
    assert len(families) == len(set(families))
    assert page.endswith("\n")


async def test_the_camera_shows_what_it_sees_now(bench: Bench) -> None:
    answer = await bench.client.get("/camera/frame.png")
    assert answer.headers["content-type"] == "image/png"
    assert answer.content.startswith(b"\x89PNG")


async def test_get_calibrate_moves_nothing_and_says_how_to_start(bench: Bench) -> None:
    words = (await bench.client.get("/calibrate", headers={"accept": "text/plain"})).text
    assert "no calibration is active" in words
    assert f"curl -X POST -H 'Accept: text/plain' '{bench.url}/calibrate?wait=120'" in words
    assert "warning: the box is checked at goals only" in words
    assert (await bench.client.get("/calibrate")).json()["poses"] == "5 taught in the settings"
    assert not bench.robot.goals


@pytest.mark.parametrize(
    ("stated", "end"),
    [
        ({"count": 8}, "up to 8 planned one after the other"),
        ({"count": 8, "tolerance_mm": 0.5}, "up to 8 planned one after the other"),
        ({"tolerance_mm": 0.5}, "until a measured point is known to U = 0.5 mm"),
        ({}, "up to 11 planned one after the other, until a measured point is known to U = 1 mm (not stated by you)"),
    ],
)
async def test_get_calibrate_says_when_a_planned_run_ends(tmp_path: Path, stated: dict[str, Any], end: str) -> None:
    async with serving(settings_for(tmp_path, calibration={"poses": [], **stated})) as bench:
        assert (await bench.client.get("/calibrate")).json()["poses"].endswith(end)


async def test_events_report_every_step_and_can_be_caught_up(bench: Bench) -> None:
    run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    events = await read_events(bench.client, until="finished", last_event_id="0")
    states = [json.loads(event["data"])["state"] for event in events if event["event"] == "run"]
    assert states == ["moving", "settling", "capturing"] * 5 + ["detecting", "solving", "finished"]
    assert [int(event["id"]) for event in events] == list(range(1, len(events) + 1))
    assert json.loads(events[-1]["data"])["id"] == run["id"]
    late = await read_events(bench.client, until="finished", last_event_id=str(len(events) - 2))
    assert [event["id"] for event in late] == [str(len(events) - 1), str(len(events))]


async def test_an_event_stream_ends_when_the_daemon_stops(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench, bench.client.stream("GET", "/events") as answer:
        lines = answer.aiter_lines()
        assert (await anext(lines)).startswith(":")
        bench.application.begin_stop("the test")
        async with asyncio.timeout(LIMIT_S):
            assert [line async for line in lines] == [""]


async def test_a_defect_is_a_problem_too_and_the_daemon_stays_up(bench: Bench) -> None:

    async def broken() -> None:
        raise ZeroDivisionError

    bench.robot.read_pose = broken  # type: ignore[method-assign, assignment]
    problem = await refused(bench, "GET", "/robot")
    assert (problem["status"], problem["code"]) == (500, "internal-error")
    assert (await bench.client.get("/health")).json()["status"] == "alive"


def test_a_status_has_one_name_whichever_python_this_is() -> None:
    assert [reason_phrase(status) for status in (404, 413, 422)] == [
        "Not Found",
        "Content Too Large",
        "Unprocessable Content",
    ]
