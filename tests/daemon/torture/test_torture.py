"""A short torture; `make torture` is the long one. And the torture itself is tried on a store that forgets."""

import asyncio
import random
from pathlib import Path

import pytest

from daemon.runtime.failpoints import PLACES
from tests.daemon.cell_under_test import pose_json, serving, settings_for
from tests.daemon.fakes import poses_around_the_target
from tests.daemon.torture.ledger import Ledger, Lost, Request
from tests.daemon.torture.torture import Torture
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

TWO_POSES = [pose_json(pose) for pose in poses_around_the_target(2)]


def test_nothing_is_lost_by_a_few_kills(tmp_path: Path) -> None:
    torture = Torture(tmp_path, random.Random(4))
    for number in range(4):
        torture.round(number)
    assert sum(torture.report.killed.values()) == 4


async def test_every_failpoint_that_is_named_is_reached_by_the_daemon_itself(tmp_path: Path) -> None:
    seen: list[str] = []

    class Seen:
        def __call__(self, place: str) -> None:
            seen.append(place)

    async with serving(settings_for(tmp_path), at=Seen()) as bench:
        await bench.client.post("/calibrate?wait=200", json={"count": 3})
        assert set(seen) == set(PLACES)
        assert [seen.count(f"{when} {what}") for when in ("before", "after") for what in ("move", "capture")] == [3] * 4
        await bench.client.post("/scans", json={"capture": True, "poses": TWO_POSES})
        await bench.run_over((await bench.client.get("/runs")).json()["runs"][0]["links"]["self"])
        assert [seen.count(f"{when} {what}") for when in ("before", "after") for what in ("move", "capture")] == [5] * 4


async def test_an_arm_that_moves_after_the_restart_is_found_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torture = Torture(tmp_path, random.Random(1))
    with (
        monkeypatch.context() as somebody,
        pytest.raises(Lost, match="the arm moved, and nobody had asked"),
    ):
        somebody.setattr(Ledger, "check", lambda *_: (tmp_path / "moves").write_text("1\n"))
        for number in range(3):
            torture.round(number)


async def test_a_daemon_that_forgets_is_found_out(tmp_path: Path) -> None:
    ledger, kept = Ledger(), tmp_path / "store"
    async with serving(settings_for(kept)) as bench:
        scan = Request("scan", "/scans", {"name": "part"})

        def work() -> None:
            import httpx

            with httpx.Client(base_url=bench.url, verify=False, timeout=LIMIT_S) as client:
                ledger.sent["scan"] += 1
                ledger.acknowledged(scan, scan.send(client), client)
                ledger.check(client, kept, None)
                ledger.sent["scan"] += 1
                with pytest.raises(Lost, match="2 requests for a scan, 1 there"):
                    ledger.check(client, kept, None)
                ledger.sent["scan"] -= 1
                ledger.scans.append("never made")
                with pytest.raises(Lost, match="scan never made is gone"):
                    ledger.check(client, kept, None)

        await asyncio.to_thread(work)
