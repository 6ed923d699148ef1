"""Files of the daemon are closed to other users of the machine, whatever the process' umask."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import ply_of


@pytest.fixture(autouse=True)
def usual_umask() -> Iterator[None]:
    before = os.umask(0o022)
    yield
    os.umask(before)


def open_to_others(folder: Path) -> list[str]:
    return [str(path) for path in (folder, *folder.rglob("*")) if path.stat().st_mode & 0o007]


async def test_nothing_in_the_store_is_open_to_others(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "store"
    async with serving(settings_for(folder, calibration={"policy": "auto", "tolerance_mm": 20.0})) as bench:
        assert (await bench.client.post("/calibrate?wait=200")).json()["state"] == "finished"
        scan = (await bench.client.post("/scans")).json()
        view = {"params": {"pose": POSES[0]}, "content": ply_of(cloud(100)), "headers": PLY}
        assert (await bench.client.post(scan["links"]["views"], **view)).status_code == 201
        await bench.application.store.audit.anchor()
        assert open_to_others(folder) == []
        assert len([*folder.rglob("*")]) > 12
