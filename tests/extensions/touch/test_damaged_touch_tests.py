"""A stored touch test that is not what was stored: refused by its id, named in the list, and the others are read."""

from pathlib import Path

from daemon.store.documents import DocumentRecord
from extensions.touch.touch_tests import TOUCH_TESTS
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.damage import DOCUMENTS, OTHER_JSON, damage
from tests.daemon.records import AT, a_touch_test

BAD, GOOD, COLUMN = "touches-0", "touches-1", "touch_tests.document"


async def save_two(bench: Bench) -> None:
    await apply_calibration(bench)
    for identifier in (BAD, GOOD):
        record = DocumentRecord(identifier, "cal-1", AT, "Ann", a_touch_test())
        await bench.application.store.documents(TOUCH_TESTS).save(record)


async def test_a_damaged_touch_test_is_told_and_the_other_is_read(bench: Bench, tmp_path: Path) -> None:
    await save_two(bench)
    for value in DOCUMENTS:
        before = damage(tmp_path, COLUMN, BAD, value)
        listed, chart = [(await bench.client.get(path)).json() for path in ("/touches", "/drift")]
        refused, other = [await bench.client.get(f"/touches/{one}") for one in (BAD, GOOD)]
        damage(tmp_path, COLUMN, BAD, before)
        assert (listed["damaged"], [row["id"] for row in listed["touches"]]) == ([BAD], [GOOD]), value
        assert [row["id"] for row in chart["touch_tests"]] == [GOOD], value
        assert (refused.status_code, refused.json()["code"]) == (503, "storage-inconsistent"), (value, refused.text)
        assert BAD in refused.json()["detail"], value
        assert other.status_code == 200, (value, other.text)


async def test_nothing_is_added_to_a_damaged_touch_test(bench: Bench, tmp_path: Path) -> None:
    await save_two(bench)
    damage(tmp_path, COLUMN, BAD, OTHER_JSON)
    refused = await bench.client.post("/touch", json={"adds_to": BAD, "touches": [{"id": 1}]})
    assert refused.json()["code"] == "storage-inconsistent", refused.text


async def test_a_touch_test_without_touches_is_refused(bench: Bench) -> None:
    problem = (await bench.client.post("/touch", json={})).json()
    assert ("touches", "add it") in {(each["place"], each["fix"]) for each in problem["problems"]}, problem
