"""docs/use/rehearse.md as its readers follow it: the mock by its command, its settings checked, cells calibrated."""

import re
import tomllib
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import validate_document
from calibration.kinematics.external_axis import AxisKind
from calibration.transforms import difference, inverse
from daemon.cell.devices import open_devices
from daemon.cli.checks import check_devices
from daemon.composition import build
from daemon.config.settings import Settings
from mock_robot.__main__ import _parser, _truth_of
from mock_robot.truth.score import score_calibration
from mock_robot.truth.truth import CellTruth
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.stories.jogging import settled
from tests.stories.plant import Operator, poses_taught_for
from tests.structure import ROOT
from tests.support.serving import serve_for_tests
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

PAGE = (ROOT / "docs" / "use" / "rehearse.md").read_text()
POINT_MM = 0.5
MARK = "# what the cell gives again\n"
SCRIPT, SETTINGS = re.compile(r"```sh\n(.*?)```", re.S), re.compile(r"```toml\n(.*?)```", re.S)
CELLS = ("Two cameras and a scanner", "A track", "A turntable", "A SCARA", "A line profiler")


@dataclass
class Rehearsal:
    """A cell of the page, the daemon's client, and a person's at the cell."""

    cell: RunningCell
    ask: httpx.AsyncClient
    pendant: httpx.AsyncClient

    @property
    def truth(self) -> CellTruth:
        return self.cell.truth

    async def moved(self, **how: Any) -> None:
        """A person moves the arm, or the axis beside it, at the pendant."""
        (await self.pendant.post("/jog", json={"in_s": 0.1, **how})).raise_for_status()
        await eventually(lambda: settled(self.cell))

    async def run_over(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The calibration that was asked for, when it is over."""
        run = (await self.ask.post("/calibrate", json=asked)).json()
        return await Operator(self.ask).waits_for_the_end_of(run, 4 * LIMIT_S)

    async def calibration(self, camera: str = "camera") -> CalibrationDocument:
        answer = await self.ask.get("/calibrations/current", params={"camera": camera})
        return CalibrationDocument.model_validate(answer.json()["calibration"])


def section(title: str) -> str:
    """The page below a heading, up to the next; what stands above the first one where there is no title."""
    parts = re.split(r"^## (.*)\n", PAGE, flags=re.M)
    return dict(zip(["", *parts[1::2]], parts[0::2], strict=True))[title]


def merged(base: Mapping[str, Any], further: Mapping[str, Any]) -> dict[str, Any]:
    """What a cell gives again replaces it."""
    both = {key: merged(base[key], further[key]) for key in base.keys() & further.keys() if isinstance(base[key], dict)}
    return {**base, **further, **both}


@asynccontextmanager
async def rehearsed(title: str, folder: Path) -> AsyncIterator[Rehearsal]:
    """Command and settings of the page, at ports that the system chooses, with a hundredfold arm."""
    (command,), (options,) = SCRIPT.findall(section("")), SCRIPT.findall(section(title))
    parsed = _parser().parse_args([*command.split()[2:], *options.split()])
    profiler = None if parsed.profiler_port is None else 0
    async with running_cell(time_scale=100.0, truth=_truth_of(parsed), profiler=profiler) as cell:
        found, text = cell.announcement, SETTINGS.findall(section(""))[0] + MARK + SETTINGS.findall(section(title))[0]
        for port, place in (
            (parsed.robot_port, f"{found.robot_host}:{found.robot_port}"),
            (parsed.devices_port, str(found.devices_url).partition("//")[2]),
            (parsed.profiler_port, str(found.profiler).partition("//")[2]),
        ):
            text = text.replace(f"127.0.0.1:{port}", place)
        base, _, further = text.partition(MARK)
        content = merged(tomllib.loads(base), tomllib.loads(further))
        if "`model` of `[robot]` out" in section(title):
            del content["robot"]["model"]
        beside = {"storage": {"folder": str(folder), "reserve_mb": 0}, "server": {"port": 0}}
        settings = validate_document(Settings, merged(content, beside), "docs/use/rehearse.md")
        checks = await check_devices(settings)
        print("rehearsal:", title, *(f"\n    {check.line()}" for check in checks))
        assert [check.line() for check in checks if not check.ok] == []
        async with (
            serve_for_tests(build(settings, open_devices)) as served,
            httpx.AsyncClient(base_url=served.url, verify=False, timeout=6 * LIMIT_S) as ask,
            httpx.AsyncClient(base_url=found.control_url, trust_env=False, timeout=LIMIT_S) as pendant,
        ):
            await Operator(ask).waits_until_ready()
            yield Rehearsal(cell, ask, pendant)


def test_each_cell_of_the_page_is_rehearsed() -> None:
    assert re.findall(r"^## (.*)$", PAGE, flags=re.M) == [*CELLS]


@pytest.mark.parametrize(
    ("title", "page", "number", "apart"),
    [
        ("Two cameras and a scanner", "cells.md", 0, {"address", "limit_s"}),
        ("A track", "cells.md", 1, {"box_mm"}),
        ("A SCARA", "arms.md", 0, {"poses"}),
    ],
)
def test_the_settings_are_those_of_their_page(title: str, page: str, number: int, apart: set[str]) -> None:
    def bare(content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        return {key: bare(value) for key, value in content.items() if key not in apart}

    theirs = SETTINGS.findall((ROOT / "docs" / page).read_text())[number]
    assert bare(tomllib.loads(SETTINGS.findall(section(title))[0])) == bare(tomllib.loads(theirs))


async def test_two_cameras_and_a_scanner(tmp_path: Path) -> None:
    async with rehearsed("Two cameras and a scanner", tmp_path) as cell:
        run = await cell.run_over({"together": ["wrist", "door"], "count": 8})
        assert run["state"] == "finished" and run["result"]["together"]["refused"] == {}, run
        for name, truth in (("camera", cell.truth), ("wrist", cell.truth.of_camera("wrist"))):
            found = (await cell.calibration(name)).mount_T_camera
            assert found is not None and score_calibration(truth, found.transform())["point_rms_mm"] < POINT_MM
        (rig,) = (await cell.ask.get("/rigs")).json()["rigs"]
        placed = {each["name"]: PoseDocument.model_validate(each["mount_T_sensor"]) for each in rig["rig"]["sensors"]}
        assert difference(placed["door"].transform(), cell.truth.further_scanners["door"])[0] < POINT_MM


@pytest.mark.parametrize(("title", "kind"), [("A track", "track"), ("A turntable", "turntable")])
async def test_an_axis_beside_the_arm(tmp_path: Path, title: str, kind: AxisKind) -> None:
    readings = {"track": (-1000.0, 0.0, 1000.0), "turntable": (-120.0, 0.0, 120.0)}[kind]
    async with rehearsed(title, tmp_path) as cell:
        axis = cell.truth.mounting.beside
        assert axis is not None
        (await cell.pendant.post("/mode", json={"mode": "MANR"})).raise_for_status()
        run = (await cell.ask.post("/calibrate", json={"manual": True})).json()
        taken = 0
        for reading in readings:
            await cell.moved(axis_beside=reading)
            moved = inverse(axis.motion(axis.reading([reading])))
            there, seen = [PoseDocument.of(moved @ pose.transform()) for pose in poses_taught_for(7)], 0
            for pose in there:
                if seen == 3:
                    break
                try:
                    await cell.moved(base_T_flange=pose.model_dump(mode="json"))
                except httpx.HTTPStatusError:  # the arm does not reach as far from there
                    continue
                run = (await cell.ask.post(run["links"]["stations"])).json()
                assert run.get("state") == "waiting", run
                seen += 1
            taken += seen
        assert taken == 9
        (await cell.ask.post(run["links"]["finish"])).raise_for_status()
        run = await Operator(cell.ask).waits_for_the_end_of(run)
        assert run["state"] == "finished", run["cause"]
        document = await cell.calibration()
        assert document.external_axis is not None and document.mount_T_camera is not None
        off = np.linalg.norm(np.cross(document.external_axis.axis().direction, axis.direction))
        assert np.degrees(off) < 0.02
        assert score_calibration(cell.truth, document.mount_T_camera.transform())["point_rms_mm"] < POINT_MM


async def test_a_scara(tmp_path: Path) -> None:
    async with rehearsed("A SCARA", tmp_path) as cell:
        tilted = {"translation_mm": [900, 0, 850], "quaternion_wxyz": [0.1, 0.99, 0, 0]}
        with pytest.raises(httpx.HTTPStatusError, match="422"):
            await cell.moved(base_T_flange=tilted)
        run = await cell.run_over({})
        assert run["state"] == "finished", run["cause"]
        document = await cell.calibration()
        assert document.axis_offset is not None and document.mount_T_camera is not None
        assert score_calibration(cell.truth, document.mount_T_camera.transform())["point_rms_mm"] < POINT_MM


async def test_a_line_profiler(tmp_path: Path) -> None:
    async with rehearsed("A line profiler", tmp_path) as cell:
        (profiler,) = [each for each in (await cell.ask.get("/devices")).json() if each["name"] == "scanner"]
        assert profiler["connected"], profiler
