"""The rows in order, and the run: one result a row, whatever happens in it."""

import re
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from hashlib import sha256
from typing import ClassVar, Literal

from pydantic import ConfigDict

from calibration.errors import CalibrationError
from drivers.errors import DeviceError
from drivers.robots.abb.acceptance import rows_link, rows_motion
from drivers.robots.abb.acceptance.bench import Bench, RowFailed, RowSkipped
from drivers.robots.abb.acceptance.person import KEYLESS
from drivers.robots.abb.acceptance.rows_link import Measured

Verdict = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class Row:
    """One assumption and its check. `person`: somebody has to be at the controller."""

    code: str
    run: Callable[[Bench], Awaitable[Measured]]
    person: bool = False

    @property
    def assumption(self) -> str:
        return (self.run.__doc__ or "").strip()


@dataclass(frozen=True)
class RowResult:
    """One assumption, what was seen when it failed or why it was skipped, and what was measured."""

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    code: str
    """Stable code of the row."""
    assumption: str
    """What is assumed of the controller."""
    verdict: Verdict
    """passed, failed or skipped."""
    what: str
    """What was seen when it failed, or why it was skipped."""
    measured: Measured
    """Figures by name, with the unit in the name."""
    seconds: float
    """How long it took, s."""

    def line(self) -> str:
        """passed  code  what"""
        shown = self.what or ", ".join(f"{name} {value}" for name, value in self.measured.items())
        return f"{self.verdict:<8}{self.code:<18}{shown}"


ROWS: tuple[Row, ...] = (
    Row("ready", rows_link.see_ready),
    Row("equipment", rows_link.see_equipment),
    Row("services", rows_link.see_services),
    Row("mastership", rows_link.see_mastership),
    Row("selection", rows_link.see_selection),
    Row("clean-line", rows_link.see_clean_line),
    Row("timings", rows_link.time_commands),
    Row("pose", rows_link.see_pose),
    Row("posture", rows_link.see_posture),
    Row("frames", rows_link.see_frames, person=True),
    Row("second-client", rows_link.second_client),
    Row("egm", rows_link.see_egm),
    Row("refusals", rows_motion.refuse, person=True),
    Row("round-trip", rows_link.round_trip, person=True),
    Row("clock", rows_motion.keep_time, person=True),
    Row("stop", rows_motion.stop, person=True),
    Row("camera-speed", rows_motion.camera_speed, person=True),
    Row("borders", rows_motion.borders, person=True),
    Row("silence", rows_motion.fall_silent, person=True),
    Row("killed", rows_motion.kill_client, person=True),
    Row("plug", rows_motion.pull_plug, person=True),
    Row("estop", rows_motion.press_estop, person=True),
    Row("key", rows_motion.turn_key, person=True),
    Row("enabling-device", rows_motion.release_enabling_device, person=True),
    Row("program-stop", rows_motion.stop_program, person=True),
    Row("restart", rows_motion.restart, person=True),
    Row("events", rows_link.see_events, person=True),
    Row("event-log", rows_link.watch_log),
    Row("reads", rows_link.read_often),
    Row("power-cut", rows_motion.cut_power, person=True),
    Row("power-cut-main", rows_motion.cut_power_to_main, person=True),
)
"""In the order of an hour at the controller, mains cuts last. With `person` a row moves the arm, or asks."""


BACKGROUND = (
    "{task} is semi-static: the pendant does not list it. To see, stop or debug it, RobotStudio: Configuration, "
    "Controller, Task: {task}, Type NORMAL, restart; afterwards SEMISTATIC again"
)
_MODULE_FILE = re.compile(r"HOME:/(.+/\w+_(?:shared|comm|motion|main|egm)\.\w+)", re.IGNORECASE)


async def head(bench: Bench) -> dict[str, str]:
    """The controller, RobotWare, hashes of the program's files, its background task; {} without services.

    A cabinet without a key is spoken of as one.
    """
    if bench.services is None:
        return {}
    shown = {}
    try:
        async with bench.administration() as controller:
            system = await controller.read_first("/rw/system")
            shown = {name: str(system[name]) for name in ("name", "rwversion") if name in system}
            if any("keyless" in option.lower() for option in await controller.read_options() or ()):
                bench.choose = KEYLESS
            for each in await controller.read_instances("SYS", "CAB_TASK_MODULES"):
                found = _MODULE_FILE.fullmatch(each.attributes.get("File", ""))
                content = await controller.read_file(found[1]) if found else None
                if content is not None:
                    shown[each.name] = f"SHA-256 {sha256(content).hexdigest()[:16]}"
                    if each.name.lower().endswith("_comm"):
                        shown["background task"] = BACKGROUND.format(task=each.attributes.get("Task", ""))
    except DeviceError as error:
        shown["not read"] = str(error)
    return shown


async def run_rows(bench: Bench, rows: Iterable[Row], note: Callable[[RowResult], None]) -> list[RowResult]:
    """Run the rows one after the other; `note` gets each result as it is there."""
    results = []
    for row in rows:
        began_s, what, measured, verdict = bench.timing.clock(), "", {}, "passed"
        try:
            measured = await row.run(bench)
        except RowSkipped as skipped:
            verdict, what = "skipped", str(skipped)
        except (RowFailed, DeviceError, CalibrationError) as error:
            verdict, what = "failed", str(error)
        seconds = round(bench.timing.clock() - began_s, 2)
        result = RowResult(row.code, row.assumption, verdict, what, measured, seconds)  # type: ignore[arg-type]
        results.append(result)
        note(result)
    return results
