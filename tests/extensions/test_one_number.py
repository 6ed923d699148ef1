"""One number everywhere: U (k = 2) at the worst of the points that matter has the same digits in every place."""

import json
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from calibration.documents.calibration_text import accuracy_text
from calibration.documents.numbers import significant
from daemon.cli.demo_run.scenario import DemoResult, report
from protocols.plc.codes import ContentsBit, ControlBit, StatusBit
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.extensions.plc.plcs import MOVING, ladder, value_of
from tests.support.waiting import LIMIT_S

FIELDS = ("expanded_mm", "worst_point", "tolerance_mm", "tolerance_stated", "expected_mm", "before_mm", "why")
PLC_LENGTHS = {
    "u_worst": "expanded_mm",
    "tolerance": "tolerance_mm",
    "u_expected": "expected_mm",
    "u_before": "before_mm",
}
TEXT = {"Accept": "text/plain"}


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    calibration = {"policy": "auto", "tolerance_mm": 20.0}
    async with serving(settings_for(tmp_path, calibration=calibration, plc=MOVING)) as running:
        yield running


def stated_in(place: dict[str, Any]) -> dict[str, Any]:
    return {name: place[name] for name in FIELDS}


async def test_every_place_shows_the_same_digits_of_one_calibration(bench: Bench) -> None:
    """Calibrated twice, the second time by a PLC: the second one replaces the first."""
    before = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()["result"]
    async with ladder(bench) as plc:
        await plc.sets(ControlBit(0))
        await plc.waits(StatusBit.READY | StatusBit.ONLINE)
        await plc.triggers(ControlBit.TRIGGER_CALIBRATE)
        image = await plc.result()
    run_id = str(value_of(image, "run_id"))
    run = (await bench.client.get(f"/runs/{run_id}")).json()
    truth = stated_in(run["result"])
    assert truth["before_mm"] == before["expanded_mm"]
    assert run["result"]["applied"] and None not in (truth["expanded_mm"], truth["expected_mm"])

    document = (await bench.client.get(f"/calibrations/{run_id}")).json()
    assert document["accuracy"] == truth
    worst = max(document["uncertainty"]["points"], key=lambda point: point["expanded_mm"])
    assert (worst["expanded_mm"], worst["name"]) == (truth["expanded_mm"], truth["worst_point"])
    newest = (await bench.client.get("/calibrations")).json()["calibrations"][0]
    current = (await bench.client.get("/calibrations/current")).json()
    status = (await bench.client.get("/calibrate")).json()
    for place in (newest, current, status["current"], status["last_run"]["result"]):
        assert stated_in(place) == truth

    for place in (*await events_of(bench, run_id), *await messages_of(bench, run_id)):
        assert stated_in(place) == truth
    assert value_of(image, "worst_point") == truth["worst_point"][:24]
    for register, field in PLC_LENGTHS.items():
        assert value_of(image, register) == pytest.approx(truth[field], rel=1e-6)
        assert value_of(image, f"{register}_um") == round(1e3 * truth[field])
    known = ContentsBit.TOLERANCE_STATED | ContentsBit.EXPECTED | ContentsBit.BEFORE | ContentsBit.IN_FORCE
    assert ContentsBit(int(value_of(image, "contents"))) & known == known

    metrics = (await bench.client.get("/metrics")).text
    for field in ("expanded_mm", "expected_mm", "before_mm"):
        (metre,) = re.findall(rf"^handeyed_calibration_{field.removesuffix('_mm')}_meters (\S+)$", metrics, re.M)
        assert float(metre) == truth[field] / 1e3
    (metre,) = re.findall(r'^handeyed_calibration_tolerance_meters\{stated="true"\} (\S+)$', metrics, re.M)
    assert float(metre) == truth["tolerance_mm"] / 1e3


async def test_every_text_says_the_same_digits(bench: Bench, tmp_path: Path) -> None:
    for _ in range(2):
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    _, record = await bench.application.store.current()
    assert record.id == run["id"]
    truth, line = record.document.accuracy, accuracy_text(record.document.accuracy)
    U, expected, before = (significant(one) for one in (truth.expanded_mm, truth.expected_mm, truth.before_mm))
    begins = f"U = {U} mm (k = 2) at {truth.worst_point}; tolerance 20 mm; expected {expected} mm; before {before} mm"
    assert line.startswith(begins)
    for path in ("/calibrate", f"/runs/{run['id']}", f"/calibrations/{run['id']}", "/calibrations/current"):
        text = (await bench.client.get(path, headers=TEXT)).text
        assert line in text, path
        assert not re.search(r"\bwithin\b", text), f"{path}: within is said of a tolerance only"
    score = {
        "calibration": {"translation_mm": 0.1, "rotation_deg": 0.01, "point_rms_mm": 0.1},
        "cloud": {"points": 1, "covered": 1.0, "rms_mm": 0.1},
    }
    truth_x = {"flange_T_camera": run["result"] and record.document.flange_T_camera.model_dump()}
    demo = report(DemoResult(record.document, tmp_path, tmp_path, "s", truth_x, score))
    assert f"± {U} mm" in demo and line in demo and "within" not in demo
    html = (await bench.client.get(f"/calibrations/{run['id']}/report")).text
    said = re.findall(r"(?<!would leave )U = ([\d.]+) mm", html)
    assert said and set(said) == {U}, "the report's U, wherever it stands"
    assert f"before the run: {expected} mm" in html and f"active calibration before: {before} mm" in html


async def events_of(bench: Bench, calibration_id: str) -> list[dict[str, Any]]:
    """The events `calibration` and `applied` of this one."""
    await bench.application.events.flush()
    found, last = [], bench.application.events.last
    async for event in bench.application.events.listen(0):
        if (
            event is not None
            and event.kind in ("calibration", "applied")
            and event.data["calibration_id"] == calibration_id
        ):
            found.append(event.data)
        if event is None or event.number >= last:
            break
    assert len(found) == 2
    return found


async def messages_of(bench: Bench, calibration_id: str) -> list[dict[str, Any]]:
    """What webhooks are told of this one."""
    query = "SELECT data FROM outbox WHERE topic IN ('calibration.stored', 'calibration.applied') ORDER BY number"
    rows = await bench.application.store._database.read(lambda db: db.execute(query).fetchall())
    found = [data for (text,) in rows if (data := json.loads(text))["calibration_id"] == calibration_id]
    assert len(found) == 2
    return found
