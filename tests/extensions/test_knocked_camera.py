"""A camera that was knocked: the alarm reaches REST, events, webhooks, PLC and metrics."""

import asyncio
import json
import re
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.transforms import transform
from daemon.drift.monitor import DriftMonitor
from protocols.plc.codes import ControlBit, DriftState, PlcVerdict, StatusBit
from tests.daemon.cell_under_test import Bench
from tests.daemon.knocked_camera import calibrated
from tests.extensions.plc.plcs import MOVING, ladder, value_of
from tests.support.waiting import LIMIT_S, eventually


async def alarms_in(bench: Bench) -> list[dict[str, Any]]:
    """What webhooks are told of alarms."""
    rows = await bench.application.store._database.read(
        lambda db: db.execute("SELECT data FROM outbox WHERE topic = 'alarm' ORDER BY number").fetchall()
    )
    return [json.loads(data) for (data,) in rows]


@pytest.mark.slow
async def test_a_knocked_camera_raises_the_alarm_everywhere_and_a_new_calibration_ends_it(tmp_path: Path) -> None:
    async with calibrated(tmp_path, plc=MOVING) as (bench, camera), ladder(bench) as plc:
        watch = bench.application.service(DriftMonitor)
        assert watch.report.standing in ("off", "learning")
        for _ in range(4):
            await bench.verify()
        await eventually(lambda: watch.report.verifications == 4)
        assert watch.report.standing == "steady"
        assert watch.report.alarm is None
        assert (await bench.client.get("/ready")).json()["warnings"] == []
        await plc.waits(StatusBit.ONLINE, unwanted=StatusBit.DRIFT_ALARM)

        camera.knock = transform(np.eye(3), [0.0, 3.0, 0.0])
        heard = bench.application.events.last
        await plc.sets(ControlBit(0))
        await plc.waits(StatusBit.READY)
        await plc.triggers(ControlBit.TRIGGER_VERIFY)
        image = await plc.result()
        assert value_of(image, "verdict") == PlcVerdict.REJECTED
        await plc.waits(StatusBit.DRIFT_ALARM)
        assert value_of(await plc.image(), "drift_state") == DriftState.DRIFTING
        assert value_of(await plc.image(), "drift_shift") > 100
        (warning,) = (await bench.client.get("/ready")).json()["warnings"]
        assert "calibrate before parts go wrong" in warning
        metrics = (await bench.client.get("/metrics")).text
        assert "\nhandeyed_drift_alarm 1\n" in metrics
        assert "\nhandeyed_drift_verifications 5\n" in metrics
        (verified,) = re.findall(r"\nhandeyed_drift_verified_timestamp_seconds (\S+)\n", metrics)
        assert float(verified) == datetime.fromisoformat(watch.chart.points[-1].at).timestamp()
        async with asyncio.timeout(LIMIT_S):
            async for event in bench.application.events.listen(heard):
                if event is not None and event.kind == "drift":
                    break
        assert event.data["alarm"] == warning
        told = await alarms_in(bench)
        assert [(alarm["kind"], alarm["raised"], alarm["what"]) for alarm in told] == [("drift", True, warning)]

        run = await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        assert run["result"]["not_applied"]["id"] == "not-applied-contradicts", (
            "a person decides: the camera was knocked"
        )
        await bench.client.post(f"/calibrations/{run['id']}/apply", json={"applied_by": "Ann"})
        await eventually(lambda: watch.report.alarm is None)
        assert [alarm["raised"] for alarm in await alarms_in(bench)] == [True, False]
        async with asyncio.timeout(LIMIT_S):
            async for event in bench.application.events.listen(heard):
                if event is not None and event.kind == "drift" and event.data["standing"] == "learning":
                    break
        assert event.data["alarm"] is None
        assert (await bench.client.get("/ready")).json()["warnings"] == []
