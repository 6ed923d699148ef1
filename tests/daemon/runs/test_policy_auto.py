"""Policy auto: what is worse than the active calibration, or contradicts it, waits for a person."""

import sqlite3
from collections.abc import AsyncIterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.errors import DocumentError
from calibration.transforms import transform
from daemon.config.settings import NamedCameraSettings
from daemon.model.records import AppliedCalibration, CalibrationRecord
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.named_cameras import wrist
from tests.support.waiting import LIMIT_S

AUTO = {"policy": "auto", "tolerance_mm": 20.0}


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    async with serving(settings_for(tmp_path, calibration=AUTO)) as running:
        yield running


async def calibrate(bench: Bench) -> dict[str, Any]:
    answer = await bench.client.post("/calibrate", params={"wait": LIMIT_S})
    run: dict[str, Any] = answer.json()
    return run


async def put_in_force(bench: Bench, document: CalibrationDocument) -> None:
    store = bench.application.store
    await store.save_calibration(CalibrationRecord(document.id, None, document.created_at, True, document))
    await store.apply(AppliedCalibration(document.id, document.created_at, "Ann"))


def known(document: CalibrationDocument, calibration_id: str, factor: float) -> CalibrationDocument:
    """The same X, with a U `factor` times as large."""
    assert document.uncertainty is not None
    covariance = tuple(tuple(factor**2 * value for value in row) for row in document.uncertainty.covariance or ())
    points = tuple(
        point.model_copy(update={name: factor * getattr(point, name) for name in ("sigma_mm", "expanded_mm")})
        for point in document.uncertainty.points
    )
    uncertainty = document.uncertainty.model_copy(update={"covariance": covariance, "points": points})
    accuracy = document.accuracy.of_uncertainty(uncertainty)
    return document.model_copy(update={"id": calibration_id, "uncertainty": uncertainty, "accuracy": accuracy})


def moved(document: CalibrationDocument, calibration_id: str, shift_mm: float) -> CalibrationDocument:
    """The camera `shift_mm` elsewhere."""
    assert document.flange_T_camera is not None
    x = transform(np.eye(3), [shift_mm, 0.0, 0.0]) @ document.flange_T_camera.transform()
    return document.model_copy(update={"id": calibration_id, "flange_T_camera": PoseDocument.of(x)})


async def first(bench: Bench) -> CalibrationDocument:
    run = await calibrate(bench)
    assert run["result"]["applied"], "nothing was active before"
    assert run["result"]["before_mm"] is None
    return (await bench.application.store.current())[1].document


@pytest.mark.parametrize(("factor", "applied"), [(0.5, False), (0.85, True), (2.0, True)])
async def test_what_is_worse_waits(bench: Bench, factor: float, applied: bool) -> None:
    """The fake cell's second calibration is as good as its first: U is 1 / `factor` of the active one."""
    better = known(await first(bench), "better", factor)
    await put_in_force(bench, better)
    run = await calibrate(bench)
    result = run["result"]
    assert (result["accepted"], result["applied"]) == (True, applied)
    assert result["before_mm"] == better.accuracy.expanded_mm
    assert (result["not_applied"] is None) is applied
    in_force, _ = await bench.application.store.current()
    assert (in_force.calibration_id == result["calibration_id"]) is applied


async def test_what_waits_says_both_numbers_in_result_event_webhook_and_text(bench: Bench) -> None:
    await put_in_force(bench, known(await first(bench), "better", 0.5))
    run = await calibrate(bench)
    why = run["result"]["not_applied"]
    assert why["id"] == "not-applied-worse"
    assert why["params"] == {name: run["result"][name] for name in ("expanded_mm", "before_mm")}
    events = [event async for event in listened(bench) if event.data.get("id") == run["id"]]
    assert events[-1].data["not_applied"] == why
    rows = await bench.application.store._database.read(
        lambda db: db.execute(
            "SELECT data ->> '$.not_applied.message' FROM outbox WHERE topic = 'run.ended'"
        ).fetchall()
    )
    assert rows[-1] == (why["message"],)
    for path in (f"/runs/{run['id']}", "/calibrate"):
        text = (await bench.client.get(path, headers={"Accept": "text/plain"})).text
        assert why["message"] in text
    applied = await bench.client.post(f"/calibrations/{run['result']['calibration_id']}/apply", json={})
    assert applied.status_code == 200, "a person may activate it"


@pytest.mark.parametrize(("policy", "says"), [("auto", True), ("operator", False)])
async def test_what_waits_says_so_after_a_restart_before_the_run_s_end_was_stored(
    tmp_path: Path, policy: str, says: bool
) -> None:
    settings = settings_for(tmp_path, calibration={**AUTO, "policy": policy})
    async with serving(settings) as bench:
        document = (await calibrate(bench))["result"]["calibration_id"]
        found = (await bench.application.store.calibration(document)).document
        await put_in_force(bench, known(found, "better", 0.5))
        run = await calibrate(bench)
    with closing(sqlite3.connect(tmp_path / "handeyed.sqlite")) as db, db:
        db.execute("UPDATE runs SET state = 'solving', result = NULL WHERE id = ?", (run["id"],))
    async with serving(settings) as bench:
        again = (await bench.client.get(run["links"]["self"])).json()
    assert again["state"] == "finished"
    assert (again["result"]["not_applied"] is not None) is says
    assert again["result"] == run["result"]


async def test_what_contradicts_the_calibration_in_force_waits(bench: Bench) -> None:
    found = await first(bench)
    assert found.accuracy.expanded_mm is not None
    await put_in_force(bench, moved(found, "elsewhere", 20 * found.accuracy.expanded_mm))
    result = (await calibrate(bench))["result"]
    assert (result["applied"], result["not_applied"]["id"]) == (False, "not-applied-contradicts")
    assert {"expanded_mm", "before_mm", "difference_mm", "point"} <= result["not_applied"]["params"].keys()


@pytest.mark.parametrize("calibration", [{"policy": "auto"}, {"policy": "auto", "verdict": {"image_px": 0.4}}])
def test_auto_needs_a_stated_tolerance(tmp_path: Path, calibration: dict[str, Any]) -> None:
    with pytest.raises(DocumentError, match="needs tolerance_mm"):
        settings_for(tmp_path, calibration=calibration)


def test_a_further_camera_has_the_tolerance_of_the_first(tmp_path: Path) -> None:
    further = wrist()
    further["calibration"].pop("tolerance_mm")
    settings = settings_for(tmp_path, calibration=AUTO, cameras={"wrist": further})
    assert settings.of_camera("wrist").calibration.tolerance_mm == AUTO["tolerance_mm"]
    assert isinstance(settings.cameras["wrist"], NamedCameraSettings)
    with pytest.raises(DocumentError, match="needs tolerance_mm"):
        settings_for(tmp_path, cameras={"wrist": further})


async def test_without_a_stated_tolerance_one_millimetre_is_used_and_said(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        run = await calibrate(bench)
        result = run["result"]
        assert (result["tolerance_mm"], result["tolerance_stated"]) == (1.0, False)
        text = (await bench.client.get(f"/runs/{run['id']}", headers={"Accept": "text/plain"})).text
        assert "tolerance 1 mm, not stated by you" in text
        rule = (await bench.client.get(f"/calibrations/{result['calibration_id']}")).json()["verdict"]["rule"]
        assert rule["id"] == "rule-not-stated"


async def listened(bench: Bench) -> AsyncIterator[Any]:
    await bench.application.events.flush()
    last = bench.application.events.last
    async for event in bench.application.events.listen(0):
        yield event
        if event is None or event.number >= last:
            return
