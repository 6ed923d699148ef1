"""A disk that refuses while the daemon works: it says so, stays up, and goes on when there is room again."""

import errno
import shutil
from collections import namedtuple
from dataclasses import dataclass
from pathlib import Path

import pytest

from daemon.store.store import Store
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import ply_of


@dataclass
class Disk:
    """Fails at one place, while it is broken."""

    place: str
    code: int
    broken: bool = False

    def __call__(self, place: str) -> None:
        if self.broken and place == self.place:
            raise OSError(self.code, "the disk says no")


PLACES = ["before write", "before fsync", "before rename", "before fsync of the folder", "before commit"]


@pytest.mark.parametrize(("code", "status"), [(errno.EIO, 500), (errno.ENOSPC, 507)])
@pytest.mark.parametrize("place", PLACES)
async def test_what_cannot_be_saved_is_reported_and_the_daemon_goes_on(
    tmp_path: Path, place: str, code: int, status: int
) -> None:
    disk = Disk(place, code)
    async with serving(settings_for(tmp_path), store=Store(tmp_path, at=disk)) as bench:
        scan = (await bench.client.post("/scans")).json()
        view = {"params": {"pose": POSES[0]}, "content": ply_of(cloud(10)), "headers": PLY}
        disk.broken = True
        first = await bench.client.post(scan["links"]["views"], **view)
        if place == "before write":  # of small files: the view is stored, scan.json is brought up to date later
            assert first.status_code == 201
        else:
            assert (first.status_code, first.headers["content-type"]) == (status, "application/problem+json")
            assert first.json()["fix"]
        run = await bench.client.post("/calibrate?wait=200", json={"count": 3})
        if run.status_code == 200:  # it began, and could not keep its first picture
            assert run.json()["state"] == "failed"
            assert run.json()["cause"]["code"] in ("storage-error", "storage-full")
        else:
            assert run.status_code == status
        assert (await bench.client.get("/health")).status_code == 200
        assert await bench.application.work_is_alive()
        disk.broken = False
        assert (await bench.client.post(scan["links"]["views"], **view)).status_code == 201
        done = (await bench.client.post("/calibrate?wait=200", json={"count": 3})).json()
        assert done["state"] == "finished"
        listed = (await bench.client.get(scan["links"]["self"])).json()["views"]
        assert [each["view"] for each in listed] == [*range(1 + first.is_success)]


async def test_no_run_is_started_when_the_disk_has_no_room_for_it(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage(1_000_000))
    ready = await bench.client.get("/ready")
    assert (ready.status_code, ready.json()["calibrate"]["ready"]) == (503, False)
    assert "has no room for a run" in ready.json()["calibrate"]["reasons"][0]
    refused = await bench.client.post("/calibrate")
    assert (refused.status_code, refused.json()["code"]) == (507, "storage-full")
    assert bench.robot.goals == []
