"""Two people with two screens: nobody puts an active calibration over one they never saw."""

import asyncio

import pytest

from daemon.model.records import CalibrationRecord
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench


async def with_calibrations(bench: Bench, *names: str) -> None:
    for name in names:
        document = a_calibration(name)
        record = CalibrationRecord(name, None, document.created_at, True, document)
        await bench.application.store.save_calibration(record)


async def test_if_match_lets_exactly_one_of_two_through(bench: Bench) -> None:
    await with_calibrations(bench, "a", "b", "c")
    await bench.client.post("/calibrations/a/apply")
    seen = (await bench.client.get("/calibrations/current")).headers["etag"]
    answers = await asyncio.gather(
        *(bench.client.post(f"/calibrations/{name}/apply", headers={"if-match": seen}) for name in "bc")
    )
    assert sorted(answer.status_code for answer in answers) == [200, 412]
    (late,) = (answer for answer in answers if answer.status_code == 412)
    assert late.json()["code"] == "applied-meanwhile"
    (done,) = (answer for answer in answers if answer.status_code == 200)
    current = await bench.client.get("/calibrations/current")
    assert current.headers["etag"] == done.headers["etag"] != seen
    assert current.json()["applied"]["sequence"] == 2


@pytest.mark.parametrize(
    ("if_match", "status"),
    [("*", 200), ('"applied-1"', 200), ('"x", "applied-1"', 200), ('"applied-2"', 412), ('W/"applied-1"', 412),
     ('"somebody-else\'s"', 412), ("applied-1", 422), ("", 422)],
)  # fmt: skip
async def test_what_if_match_may_say(bench: Bench, if_match: str, status: int) -> None:
    await with_calibrations(bench, "a", "b")
    nothing_yet = await bench.client.post("/calibrations/a/apply", headers={"if-match": "*"})
    assert nothing_yet.status_code == 412
    await bench.client.post("/calibrations/a/apply")
    answer = await bench.client.post("/calibrations/b/apply", headers={"if-match": if_match})
    assert answer.status_code == status, answer.text


async def test_an_unchanged_calibration_is_not_sent_again(bench: Bench) -> None:
    await with_calibrations(bench, "a", "b")
    tag = (await bench.client.post("/calibrations/a/apply")).headers["etag"]
    unchanged = await bench.client.get("/calibrations/current", headers={"if-none-match": f'"x", W/{tag}'})
    assert (unchanged.status_code, unchanged.content) == (304, b"")
    await bench.client.post("/calibrations/b/apply")
    assert (await bench.client.get("/calibrations/current", headers={"if-none-match": tag})).status_code == 200
