"""What may take long is computed in a thread, and not on the event loop: the thread is looked at, and no clock."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.kinematics.arm import Arm
from daemon.api.dependencies import VALUES_ON_THE_LOOP, JsonBody
from daemon.api.routes import reports as report_routes
from daemon.runs import adaptive_sequence
from daemon.store.listings import Table
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, pose_json, serving, settings_for
from tests.daemon.fakes import poses_around_the_target
from tests.support.waiting import LIMIT_S

ARM = {"model": "IRB 1600-6/1.45"}
POSES = [pose_json(pose) for pose in poses_around_the_target()]


class Watched:
    """Which functions were called, and which of them in the thread of the test, which is the event loop's."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._patch, self._loop = patch, threading.get_ident()
        self.called: set[str] = set()
        self.on_the_loop: set[str] = set()

    def watch(self, owner: Any, *names: str) -> None:
        for name in names:
            inner = getattr(owner, name)
            self._patch.setattr(owner, name, self._noted(f"{owner.__name__}.{name}", inner))

    def _noted(self, name: str, inner: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            self.called.add(name)
            if threading.get_ident() == self._loop:
                self.on_the_loop.add(name)
            return inner(*arguments, **named)

        return call


@pytest.fixture
def watched() -> Iterator[Watched]:
    with pytest.MonkeyPatch.context() as patch:
        yield Watched(patch)


async def test_a_plan_of_taught_poses(tmp_path: Path, watched: Watched) -> None:
    """A hundred poses of an arm with an offset wrist take 0.7 s."""
    async with serving(settings_for(tmp_path, robot=ARM)) as bench:
        watched.watch(Arm, "nearest")
        watched.watch(adaptive_sequence, "skeleton_mm")
        answer = await bench.client.post("/plan", json={"poses": POSES * 20})
    assert answer.status_code == 200, answer.text
    assert watched.called == {"Arm.nearest", "daemon.runs.adaptive_sequence.skeleton_mm"}
    assert not watched.on_the_loop


async def test_the_checks_of_a_run_and_of_a_jog(tmp_path: Path, watched: Watched) -> None:
    async with serving(settings_for(tmp_path, robot=ARM)) as bench:
        watched.watch(Arm, "nearest", "all_matching")
        run = (await bench.client.post("/calibrate", json={"poses": POSES}, params={"wait": LIMIT_S})).json()
        jog = {"shift_mm": [0.0, 0.0, -5.0]}
        jogged = (await bench.client.post("/robot/jog", json=jog, params={"wait": LIMIT_S})).json()
    assert (run["state"], jogged["state"]) == ("finished", "finished"), (run, jogged)
    assert watched.called == {"Arm.nearest", "Arm.all_matching"}
    assert not watched.on_the_loop


@pytest.mark.slow
async def test_the_small_turns_of_a_first_look(tmp_path: Path, watched: Watched) -> None:
    async with serving(settings_for(tmp_path, robot=ARM, calibration={"poses": []})) as bench:
        watched.watch(Arm, "nearest", "all_matching")
        run = (await bench.client.post("/calibrate", json={"count": 3}, params={"wait": LIMIT_S})).json()
    assert run["station"] > 0, run
    assert not watched.on_the_loop


async def test_a_body_of_many_values(bench: Bench, watched: Watched) -> None:
    watched.watch(JsonBody, "_parse")
    refused = await bench.client.post("/plan", json={"poses": [{"a": 1}] * (VALUES_ON_THE_LOOP + 2)})
    assert refused.status_code == 422
    assert watched.called == {"JsonBody._parse"}
    assert not watched.on_the_loop


async def test_stored_verifications_and_calibrations(bench: Bench, watched: Watched) -> None:
    await apply_calibration(bench)
    await bench.verify()
    watched.watch(Table, "record")
    watched.watch(CalibrationDocument, "model_validate_json")
    for path in ("/drift", "/calibrations/cal-1", "/calibrations/current", "/calibrate"):
        assert (await bench.client.get(path)).status_code == 200, path
    assert watched.called == {"Table.record", "CalibrationDocument.model_validate_json"}
    assert not watched.on_the_loop


async def test_reports(bench: Bench, watched: Watched) -> None:
    """One of 500 verifications takes 24 ms."""
    await apply_calibration(bench)
    await bench.verify()
    (run,) = (await bench.client.get("/runs")).json()["runs"]
    makers = ("calibration_report", "verification_report", "drift_report", "policy_of")
    watched.watch(report_routes, *makers)
    for path in ("/calibrations/current/report", f"/runs/{run['id']}/report", "/drift/report"):
        assert (await bench.client.get(path)).status_code == 200, path
    assert watched.called == {f"daemon.api.routes.reports.{name}" for name in makers}
    assert not watched.on_the_loop
