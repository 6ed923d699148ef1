"""What a request may cost before it is refused: problems named, names compared, bytes of queries and bodies."""

import json
from typing import Any

import pytest
from fastapi import Request

from calibration.documents.validation import MAX_PROBLEMS, validate_document
from calibration.errors import DocumentError
from daemon.api.dependencies import MAX_JSON_VALUES
from daemon.api.middleware.request_checks import MAX_QUERY_BYTES, MAX_SETUP_BYTES
from daemon.api.negotiation import MAX_MEDIA_RANGES, media_ranges
from daemon.model.requests import CalibrateRequest
from tests.daemon.cell_under_test import Bench

MAX_ANSWER_BYTES = 10_000


async def refusal_of(bench: Bench, method: str, path: str, **body: Any) -> dict[str, Any]:
    answer = await bench.client.request(method, path, **body)
    assert answer.status_code >= 400
    assert len(answer.content) < MAX_ANSWER_BYTES
    return dict(answer.json())


async def test_an_answer_names_a_few_of_many_problems(bench: Bench) -> None:
    body = {f"unknown {k}": None for k in range(MAX_JSON_VALUES)}
    problem = await refusal_of(bench, "POST", "/calibrate", json=body)
    assert len(problem["problems"]) == MAX_PROBLEMS + 1
    assert problem["problems"][-1]["what"] == f"{MAX_JSON_VALUES - MAX_PROBLEMS} more problems"
    query = "&".join(f"x{k}=" for k in range(500))
    problem = await refusal_of(bench, "GET", f"/runs?{query}")
    assert problem["problems"][-1]["what"] == f"{500 - MAX_PROBLEMS} more problems"


async def test_a_body_of_too_many_values_is_refused_before_it_is_checked(bench: Bench) -> None:
    for body in ({f"k{k}": 1 for k in range(60_000)}, {"poses": [None] * 60_000}):
        problem = await refusal_of(bench, "POST", "/calibrate", json=body)
        assert (problem["status"], problem["code"]) == (400, "body-malformed")


async def test_long_names_are_shortened_and_compared_with_nothing(bench: Bench) -> None:
    problem = await refusal_of(bench, "POST", "/calibrate", json={"count" * 100_000: 3})
    assert problem["problems"][0]["fix"] == "remove it"
    problem = await refusal_of(bench, "POST", "/calibrate", json={"manual": ["x" * 500_000]})
    assert problem["problems"][0]["place"] == "manual"


def test_the_known_keys_are_collected_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from calibration.documents import validation

    calls = []
    collect = validation._places
    monkeypatch.setattr(validation, "_places", lambda model: calls.append(model) or collect(model))
    with pytest.raises(DocumentError):
        validate_document(CalibrateRequest, {f"k{k}": 1 for k in range(100)}, "test")
    assert len(calls) == 1


@pytest.mark.parametrize(
    ("method", "path", "size", "status"),
    [
        ("GET", "/health?" + "x" * (MAX_QUERY_BYTES + 1), 0, 422),
        ("POST", "/setup", MAX_SETUP_BYTES + 1, 413),
    ],
)
async def test_what_needs_no_key_is_small(bench: Bench, method: str, path: str, size: int, status: int) -> None:
    problem = await refusal_of(bench, method, path, content=b" " * size)
    assert problem["status"] == status


def test_few_media_ranges_are_read() -> None:
    accept = ",".join(["text/plain;q=0.1"] * 10_000)
    assert len(media_ranges(Request({"type": "http", "headers": [(b"accept", accept.encode())]}))) == MAX_MEDIA_RANGES


NOT_NUMBERS = ["1_000", "١٢٣", "0x10", "+", "1e", "1e1000", "infinity", "nan", "²", "1٫5", "", "5\n"]
NUMERIC = [("/runs", "limit"), ("/runs/x", "wait"), ("/drift", "limit"), ("/audit", "before"),
           ("/scans/x/cloud", "view"), ("/scans/x/cloud", "voxel_mm"), ("/scans/x/cloud", "max_points"),
           ("/scans/x/report", "wait")]  # fmt: skip


async def test_numbers_in_queries_are_digits(bench: Bench) -> None:
    for given in NOT_NUMBERS:
        for path, name in NUMERIC:
            answer = await bench.client.get(path, params={name: given})
            assert (answer.status_code, answer.json()["code"]) == (422, "request-refused"), (path, name, given)
        pose = {"pose": f"{given},2,3,1,0,0,0"}
        octets = {"content-type": "application/octet-stream"}
        answer = await bench.client.post("/scans", content=json.dumps({}))
        answer = await bench.client.post(
            f"{answer.headers['location']}/views", params=pose, headers=octets, content=b"x"
        )
        assert answer.status_code == 422, given


@pytest.mark.parametrize("given", ["5", "+5", "5e0", "0.5e+1", "5."])
async def test_numbers_are_read_however_they_are_written(bench: Bench, given: str) -> None:
    assert (await bench.client.get("/runs/none", params={"wait": given})).status_code == 404
    assert (await bench.client.get(f"/runs/none?wait={given}")).status_code == 404
