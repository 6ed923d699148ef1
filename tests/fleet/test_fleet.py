"""A plant's day: cells calibrated from OPC UA, an update in two rings, daemons killed; what three views of it say.

`make test-fleet` tries it with 20 cells; CELLS= chooses. Three of them take a minute of processor time, 20 take 9 GB.
"""

import asyncio
import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("asyncua", reason="asyncua is not here: pip install 'handeyed[opcua]'")

from mock_robot.truth.score import score_calibration
from tests.fleet.fleet import FleetCell, Prometheus, a_release, fleet_of, for_each, gateway_of, prometheus_of, until
from tests.gateways.opcua.plant import PlantClient
from tests.mock_robot.running_cell import ROOT
from tests.support.s3 import s3_server

COUNT = int(os.environ.get("HANDEYED_FLEET_CELLS", "0"))
CALIBRATING = 3
TICKETS = 3
FIRST_RING = 2
WATCHED = ("Ready", "State", "Version", "CalibrationId")
TABLE = {
    target["refId"]: target["expr"]
    for panel in json.loads((ROOT / "deploy/grafana/fleet.json").read_text(encoding="utf-8"))["panels"]
    if panel["title"] == "Cells"
    for target in panel["targets"]
}
VERSION, EXPANDED = (next(expr for expr in TABLE.values() if name in expr) for name in ("build_info", "expanded"))
BUCKET = "s3://plant-calibrations"


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.skipif(COUNT < 3, reason="a plant takes many minutes: make test-fleet")
@pytest.mark.skipif(shutil.which("prometheus") is None, reason="prometheus is not here: apt-get install prometheus")
async def test_table_archive_and_opc_ua_agree_with_the_cells_truth(tmp_path: Path) -> None:
    old, new = (a_release(tmp_path / "releases", version) for version in ("7.1.0", "7.2.0"))
    with s3_server():
        async with (
            fleet_of(COUNT, tmp_path / "cells", old) as cells,
            prometheus_of(cells, tmp_path / "prometheus") as prometheus,
            gateway_of(cells, tmp_path / "gateway") as gateway,
            gateway.client() as mes,
        ):
            await mes.listen(*(f"{cell.name}.Cell.{what}" for cell in cells for what in WATCHED))
            await for_each(cells, lambda cell: calibrate(mes, cell), CALIBRATING)
            moved = {cell.name: await cell.mock.commanded_moves() for cell in cells}
            for ring in (cells[:FIRST_RING], cells[FIRST_RING:]):
                await for_each(ring, lambda cell: cell.update(new))
                updated = cells[: FIRST_RING if ring[0] is cells[0] else COUNT]
                versions = {cell.name: ("7.2.0" if cell in updated else "7.1.0") for cell in cells}
                await agree_on_versions(versions, mes, prometheus)
            assert {cell.name: await cell.mock.commanded_moves() for cell in cells} == moved, "an update moves no arm"
            await survive_kills(cells[:: max(1, COUNT // 5)][: max(1, COUNT // 4)], new, mes, prometheus)
            await keep_calibrations(cells, tmp_path / "archive")
            await for_each(cells, lambda cell: agree_on_the_calibration(cell, mes, prometheus))


async def calibrate(mes: PlantClient, cell: FleetCell) -> None:
    """Finished at the third ticket at the latest: where one machine plays a plant, a heartbeat may be late.

    An arm whose daemon is not heard of is disarmed, and its run fails, as it should.
    """
    runs: list[dict[str, Any]] = []
    while not runs or runs[-1]["state"] != "finished":
        assert len(runs) < TICKETS, [run["cause"] for run in runs]
        await mes.waits(f"{cell.name}.Cell.Ready", True)
        runs.append(await cell.run_over(await mes.call(f"{cell.name}.Cell.Start", "calibrate", f"first-{len(runs)}")))


async def agree_on_versions(versions: dict[str, str], mes: PlantClient, prometheus: Prometheus) -> None:
    for name, version in versions.items():
        await mes.waits(f"{name}.Cell.Version", f"handeyed {version}")

    async def shown() -> bool:
        rows = await prometheus.ask("count by (cell, version) (handeyed_build_info{job='handeyed'})")
        return sorted((row["cell"], row["version"]) for row in rows) == sorted(versions.items())

    await until(shown, f"the table shows {versions}")
    differ = await prometheus.ask('count(count by (version) (handeyed_build_info{job="handeyed"})) > 1')
    assert bool(differ) == (len(set(versions.values())) > 1)


async def survive_kills(cells: list[FleetCell], release: Path, mes: PlantClient, prometheus: Prometheus) -> None:
    """Daemons killed while their arms move: the arms stop, all see it, and no ticket starts a second run."""
    runs = {cell.name: await mes.call(f"{cell.name}.Cell.Start", "calibrate", "second") for cell in cells}
    for cell in cells:
        before = await cell.mock.commanded_moves()
        await until(lambda cell=cell, before=before: _has_moved(cell, before), f"{cell.name} moves")  # type: ignore[misc]
        await cell.kill()
    for cell in cells:
        await mes.waits(f"{cell.name}.Cell.State", "Preoperational")
        assert await mes.read(f"{cell.name}.Cell.Ready") is False

    async def away() -> bool:
        up = await prometheus.by_cell('max by (cell) (up{job="handeyed"})')
        return {name for name, value in up.items() if not value} == set(runs)

    await until(away, f"the table shows that {set(runs)} are away")
    moved = {cell.name: await cell.mock.commanded_moves() for cell in cells}
    await for_each(cells, lambda cell: cell.start(release))
    for cell in cells:
        await mes.waits(f"{cell.name}.Cell.Ready", True)
        run = await cell.run_over(runs[cell.name])
        assert run["state"] != "finished"
        assert await mes.call(f"{cell.name}.Cell.Start", "calibrate", "second") == runs[cell.name]
        assert [each["id"] for each in (await cell.get("/runs"))["runs"]].count(runs[cell.name]) == 1
    assert {cell.name: await cell.mock.commanded_moves() for cell in cells} == moved, "a start moves no arm"


async def _has_moved(cell: FleetCell, before: int) -> bool:
    return await cell.mock.commanded_moves() > before


async def keep_calibrations(cells: list[FleetCell], folder: Path) -> None:
    """deploy/fleet/archive_calibrations.py for each cell, then into the bucket."""
    import fsspec

    script = str(ROOT / "deploy/fleet/archive_calibrations.py")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}

    async def archive(cell: FleetCell) -> None:
        command = (sys.executable, script, cell.name, cell.url, str(folder))
        process = await asyncio.create_subprocess_exec(*command, env=environment, stdout=asyncio.subprocess.DEVNULL)
        assert await process.wait() == 0

    await for_each(cells, archive)
    s3: Any = fsspec.filesystem("s3")
    await asyncio.to_thread(s3.mkdir, BUCKET)
    await asyncio.to_thread(s3.put, f"{folder}/", BUCKET, recursive=True)


async def agree_on_the_calibration(cell: FleetCell, mes: PlantClient, prometheus: Prometheus) -> None:
    """One calibration in archive, table and OPC UA; it is the daemon's, and true within what it claims."""
    import fsspec

    from calibration.documents.calibration import CalibrationDocument

    s3: Any = fsspec.filesystem("s3")
    [kept] = await asyncio.to_thread(s3.ls, f"{BUCKET}/{cell.name}", detail=False)
    content = await asyncio.to_thread(s3.cat_file, kept)
    document = CalibrationDocument.model_validate_json(content)
    current = await cell.get("/calibrations/current")
    assert json.loads(content) == current["calibration"] == await cell.get(f"/calibrations/{document.id}")
    assert Path(kept).name == f"{document.id}.json"
    await mes.waits(f"{cell.name}.Cell.CalibrationId", document.id)
    assert await mes.read(f"{cell.name}.Cell.U_Mm") == current["expanded_mm"]

    async def shown() -> bool:
        expanded_m = float((await prometheus.by_cell(EXPANDED)).get(cell.name, -1.0))
        return abs(1000 * expanded_m - current["expanded_mm"]) < 1e-6

    await until(shown, f"the table shows U of {cell.name}")
    version = (await prometheus.by_cell(VERSION, "version"))[cell.name]
    assert (
        f"handeyed {version}" == (await cell.get("/about"))["software"] == await mes.read(f"{cell.name}.Cell.Version")
    )
    assert document.mount_T_camera is not None
    true = score_calibration(cell.truth, document.mount_T_camera.transform())
    assert true["point_max_mm"] < 2 * current["expanded_mm"], "k = 4: hardly ever more"
