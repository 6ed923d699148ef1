"""A stored rig that is not what was stored: refused by its id, named in the list, and the others are read."""

import json
from pathlib import Path

from daemon.store.documents import DocumentRecord
from extensions.rigs.rig_sensors import STORED_RIGS
from tests.daemon.cell_under_test import Bench
from tests.daemon.clouds import OCTETS, POSE, cloud
from tests.daemon.damage import DOCUMENTS, OTHER_JSON, damage
from tests.daemon.records import AT
from tests.daemon.rig_files import a_rig

BAD, GOOD, COLUMN = "rigs-0", "rigs-1", "rigs.document"


async def save(bench: Bench, *names: str) -> None:
    for name in names:
        record = DocumentRecord(name, "eye-in-hand", AT, "Ann", json.dumps(a_rig()))
        await bench.application.store.documents(STORED_RIGS).save(record)


async def test_a_damaged_rig_is_told_and_the_other_is_read(bench: Bench, tmp_path: Path) -> None:
    await save(bench, BAD, GOOD)
    for value in DOCUMENTS:
        before = damage(tmp_path, COLUMN, BAD, value)
        listed = (await bench.client.get("/rigs")).json()
        refused, other = [await bench.client.get(f"/rigs/{one}") for one in (BAD, GOOD)]
        ready = await bench.client.get("/ready")
        damage(tmp_path, COLUMN, BAD, before)
        assert (listed["damaged"], [row["id"] for row in listed["rigs"]]) == ([BAD], [GOOD]), value
        assert (refused.status_code, refused.json()["code"]) == (503, "storage-inconsistent"), (value, refused.text)
        assert BAD in refused.json()["detail"], value
        assert (other.status_code, ready.status_code) == (200, 200), (value, other.text)


async def test_no_cloud_is_placed_by_a_damaged_rig(bench: Bench, tmp_path: Path) -> None:
    await save(bench, GOOD, BAD)
    damage(tmp_path, COLUMN, BAD, OTHER_JSON)
    content = cloud(10).astype("<f4").tobytes()
    refused = await bench.client.post(
        "/register", params={"pose": POSE, "scanner": "scanner"}, content=content, headers=OCTETS
    )
    assert refused.json()["code"] == "storage-inconsistent", refused.text
