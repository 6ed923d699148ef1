"""What the gateway shows of one cell, derived from the daemon's answers. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

FINAL = frozenset({"finished", "failed", "aborted"})
RECIPES = {"calibrate": "/calibrate", "verify": "/verify", "scan": "/scans"}
"""What may be started, and the path of its POST."""

RECIPE_OF = {"calibration": "calibrate"}
"""By the kind of a run; of others the kind."""

RESULT_STATES = {"finished": 1, "aborted": 3, "failed": 4}
"""ResultStateDataType of OPC 40100-1, 10.2.8: Completed, Aborted, Failed."""


@dataclass(frozen=True)
class CellState:
    """One cell as it was last heard of; lengths in mm."""

    reached: bool = False
    live: Mapping[str, Any] = field(default_factory=dict)
    """The newest value of each key of GET /live."""

    current: Mapping[str, Any] | None = None
    """GET /calibrations/current; None without an active calibration."""

    drift: Mapping[str, Any] = field(default_factory=dict)
    """GET /drift."""

    last: Mapping[str, Any] | None = None
    """The run that ended last, as GET /runs/ID answers it."""

    stop_unconfirmed: bool = False
    store_sound: bool = True

    @property
    def run(self) -> Mapping[str, Any] | None:
        """The run that is in progress."""
        return self.live.get("run") if self.reached else None

    @property
    def ready(self) -> bool:
        """Whether a run could be started now."""
        return self.reached and self.run is None and bool(_of(self.live, "ready", "calibrate", "ready"))

    @property
    def reason(self) -> str:
        """Why it is not ready; "" when it is."""
        if self.ready:
            return ""
        if not self.reached:
            return "the daemon does not answer"
        return "; ".join(_of(self.live, "ready", "calibrate", "reasons") or ())

    @property
    def conditions(self) -> dict[str, tuple[str, bool]]:
        """What needs attention, by its code: the sentence, and whether it is an error."""
        if not self.reached:
            return {"daemon-away": ("the daemon does not answer", True)}
        ready = self.live.get("ready") or {}
        found: dict[str, tuple[str, bool]] = {}
        for text, detail in zip(ready.get("warnings", ()), ready.get("warning_details", ()), strict=False):
            code = detail["id"]
            if code not in found:
                found[code] = (text, code.startswith("stop-unconfirmed"))
        for device in self.live.get("devices") or ():
            if not device.get("connected", True):
                found[f"device-{device['name']}"] = (f"{device['name']} does not answer", False)
        if not self.store_sound:
            found["store-unsound"] = ("nothing can be stored: GET /ready says why", True)
        return found

    def after(self, message: Mapping[str, Any]) -> "CellState":
        """After a message of GET /live, which has what changed."""
        return replace(self, reached=True, live={**self.live, **message})

    def vision_state(self) -> tuple[str, str]:
        """The state of the vision state machine, and that of its automatic mode (OPC 40100-1, 8.2 and 8.3)."""
        if not self.reached:
            return "Preoperational", "Initialized"
        inner = "SingleExecution" if self.run else "Ready" if self.ready else "Initialized"
        return ("Error" if self.stop_unconfirmed or not self.store_sound else "Operational"), inner

    def scalars(self) -> dict[str, Any]:
        """The values of the flat folder, by SCALARS."""
        run, last, robot = self.run or {}, self.last or {}, self.live.get("robot") or {}
        outer, inner = self.vision_state()
        current = self.current or {}
        points: Sequence[Any] = self.drift.get("points") or ({},)
        return {
            "Ready": self.ready,
            "Reason": self.reason,
            "State": inner if outer == "Operational" else outer,
            "RunId": run.get("id", ""),
            "RunKind": run.get("kind", ""),
            "Station": run.get("station", 0),
            "Stations": run.get("stations", 0),
            "LastRunId": last.get("id", ""),
            "LastResult": last.get("state", ""),
            "LastCode": (last.get("cause") or {}).get("code", ""),
            "CalibrationId": _of(current, "applied", "calibration_id") or "",
            "U_Mm": _number(current.get("expanded_mm")),
            "ToleranceMm": _number(current.get("tolerance_mm")),
            "Drift": self.drift.get("standing", ""),
            "DriftShiftMm": _number(self.drift.get("shift_mm")),
            "DriftLimitMm": _number(self.drift.get("limit_mm")),
            "VerifiedAt": _of(points[-1], "at") or "",
            "ArmStopUnconfirmed": self.stop_unconfirmed,
            "RobotMode": robot.get("mode", ""),
            "Version": self.live.get("software", ""),
        }


SCALARS: dict[str, tuple[str, str]] = {
    "Ready": ("Boolean", "A run could be started now."),
    "Reason": ("String", "Why it is not ready."),
    "State": ("String", "Preoperational, Error, Initialized, Ready or SingleExecution."),
    "RunId": ("String", "The run in progress."),
    "RunKind": ("String", "Its kind."),
    "Station": ("Int32", "The pose that it is at."),
    "Stations": ("Int32", "How many it has."),
    "LastRunId": ("String", "The run that ended last."),
    "LastResult": ("String", "finished, failed or aborted."),
    "LastCode": ("String", "Why it failed, a code of GET /help."),
    "CalibrationId": ("String", "The active calibration."),
    "U_Mm": ("Double", "Its U (k = 2) at the worst of the points that matter, mm; NaN without one."),
    "ToleranceMm": ("Double", "The largest U that is accepted, mm."),
    "Drift": ("String", "The standing of the drift chart."),
    "DriftShiftMm": ("Double", "How far the verifications have moved, mm."),
    "DriftLimitMm": ("Double", "How far they may, mm."),
    "VerifiedAt": ("String", "When it was verified last, ISO 8601."),
    "ArmStopUnconfirmed": ("Boolean", "It is not confirmed that the arm stands: press the emergency stop."),
    "RobotMode": ("String", "The controller's mode."),
    "Version": ("String", "Of the daemon."),
}
"""Type and meaning of each variable of the flat folder."""


def time_of(text: str) -> datetime:
    """A time of the daemon's answers."""
    return datetime.fromisoformat(text.replace("Z", "+00:00"))


def _of(found: Any, *keys: str) -> Any:
    """The value below the keys; None where one is missing or null."""
    for key in keys:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
