"""Numbers, texts and documents made to do harm, in every query and JSON body of openapi.json."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.clouds import OCTETS, POSE, cloud
from tests.daemon.scans.scan_folders import a_scan

OPENAPI: dict[str, Any] = json.loads((Path(__file__).parents[3] / "docs" / "openapi.json").read_text(encoding="utf-8"))
STREAMS = ("/events", "/live", "/camera/stream")

TEXTS = ["-1", "nan", "1e308", "1e-320", "9223372036854775808", "\x00"]
VALUES = [-1, 1e308, 10**400, "\x00", [[]], [1e308] * 7, {"a": 1}, float("nan"), "\ud800"]
BODIES = [b"[" * 100_000, b'{"a":' * 100_000, b"\xff\xfe{\x00}\x00", b"NaN", b'{"poses":1,"poses":2}', b"9" * 5000]


@pytest.mark.slow
async def test_every_query_and_body_is_answered_in_words_and_moves_nothing(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    content = cloud(100).astype("<f4").tobytes()
    await bench.client.post(scan["links"]["views"], params={"pose": POSE}, content=content, headers=OCTETS)
    ids = {"calibration_id": "cal-1", "scan_id": scan["id"], "k": "0"}
    ids |= dict.fromkeys(("run_id", "acceptance_id", "touch_id", "rig_id", "sweep_id", "name", "code"), "x")
    asked = 0
    for method, path, operation in _operations():
        url = path.format(export_format="rapid", **ids)
        for request in [*(_queries(operation) if method == "GET" else ()), *_bodies(operation)]:
            answer = await bench.client.request(method, url, **request)
            assert answer.status_code < 500, (method, path, request, answer.text)
            assert method == "GET" or answer.status_code >= 400, (path, request)
            if answer.status_code >= 400:
                assert answer.headers["content-type"] == "application/problem+json", (method, path, request)
            asked += 1
    assert asked > 300
    assert not bench.robot.goals


def _operations() -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, item in OPENAPI["paths"].items():
        if path not in STREAMS:
            yield from ((method.upper(), path, operation) for method, operation in item.items())


def _queries(operation: dict[str, Any]) -> Iterator[dict[str, Any]]:
    parameters = [_resolved(one) for one in operation.get("parameters", [])]
    names = [one["name"] for one in parameters if one["in"] == "query"]
    needed = {"voxel_mm": "50", "view": "0"} if "voxel_mm" in names else {}
    for name in names:
        yield from ({"params": {**needed, name: text}} for text in TEXTS)


def _bodies(operation: dict[str, Any]) -> Iterator[dict[str, Any]]:
    schema = operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema")
    if schema is not None:
        documents = ({name: value} for name in _names(schema) for value in VALUES)
        for body in [*BODIES, *(json.dumps(document).encode() for document in documents)]:
            yield {"content": body, "headers": {"content-type": "application/json"}}


def _names(schema: dict[str, Any]) -> list[str]:
    """The fields of a document, and of each alternative."""
    schema = _resolved(schema)
    names = list(schema.get("properties", {}))
    return names + [name for one in schema.get("anyOf", []) if one.get("type") != "null" for name in _names(one)]


def _resolved(schema: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        found = OPENAPI
        for part in schema["$ref"].removeprefix("#/").split("/"):
            found = found[part]
        schema = found
    return schema
