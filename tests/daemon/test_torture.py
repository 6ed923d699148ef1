"""A short torture; `make torture` is the long one. And the torture itself is tried on a store that forgets."""

import asyncio
import random
from pathlib import Path

import pytest

from benchmarks.torture import Ledger, Lost, Request, Torture
from daemon.store.failpoints import PLACES
from tests.daemon.cells import serving, settings_for


def test_nothing_is_lost_by_a_few_kills(tmp_path: Path) -> None:
    torture = Torture(tmp_path, random.Random(4))
    for number in range(4):
        torture.round(number)
    assert sum(torture.killed.values()) == 4


async def test_every_failpoint_that_is_named_is_reached(tmp_path: Path) -> None:
    """Moves and captures are the torture's own devices'."""
    seen: set[str] = set()

    class Seen:
        def reached(self, place: str) -> None:
            seen.add(place)

    from daemon.store.store import Store

    async with serving(settings_for(tmp_path), store=Store(tmp_path, at=Seen())) as bench:
        await bench.client.post("/calibrate?wait=30", json={"count": 3})
    assert seen == {place for place in PLACES if "move" not in place and "capture" not in place}


async def test_a_daemon_that_forgets_is_found_out(tmp_path: Path) -> None:
    ledger, kept = Ledger(), tmp_path / "store"
    async with serving(settings_for(kept)) as bench:
        scan = Request("scan", "/scans", {"name": "part"})

        def work() -> None:
            import httpx

            with httpx.Client(base_url=bench.url, timeout=30) as client:
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
