"""HTTP port for tests: read the robot's state, operate switches, switch faults. It does not reveal the truth.

A plain ASGI application: a table of routes with JSON input (body or query) and output.
"""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send

from calibration.documents.pose import PoseDocument
from calibration.errors import GeometryError
from calibration.kinematics.arm import UnreachablePoseError
from calibration.transforms import Array
from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.cabinet.panel import Mode
from mock_robot.errors import JogRefused, MockError, NoSuchState, UnknownFault
from mock_robot.faults.board import FaultBoard
from protocols.cb.codes import Command, Flag

Fields = Mapping[str, Any]
JOG_S = (0.02, 60.0)
"""Shortest and longest time of a jog."""
TRUE, FALSE = ("true", "1", "yes", "on"), ("false", "0", "no", "off")


@dataclass
class ControlPort:
    """The ASGI application. `nudge` makes the links react to a change at once."""

    controller: Cabinet
    faults: FaultBoard
    clock: Callable[[], float]
    nudge: Callable[[], None]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        request = Request(scope, receive)
        status, answer = self._answer(request.method, request.url.path, request.query_params, await request.body())
        media_type = "application/json" if status < 400 else "application/problem+json"
        await JSONResponse(answer, status, media_type=media_type)(scope, receive, send)

    def _answer(self, asked: str, path: str, query: Fields, body: bytes) -> tuple[int, Any]:
        allowed = set()
        for method, pattern, handler in _ROUTES:
            match = pattern.fullmatch(path)
            if match is None:
                continue
            if method != asked:
                allowed.add(method)
                continue
            try:
                answer = handler(self, {**query, **_fields(body), **match.groupdict()})
                answer = self._state() if answer is None else answer
            except MockError as error:
                return _problem(404 if isinstance(error, UnknownFault) else 422, str(error))
            self.nudge()
            return 200, answer
        if allowed:
            return _problem(405, f"allowed here: {', '.join(sorted(allowed))}")
        listed = ", ".join(f"{method} {pattern.pattern}" for method, pattern, _ in _ROUTES)
        return _problem(404, f"no such resource; the resources are {listed}")

    # --- handlers ---

    def _state(self) -> Any:
        now_s = self.clock()
        controller = self.controller
        controller.tick(now_s)
        robot_s = controller.robot_s(now_s)
        flags = controller.flags(now_s)
        return {
            "joints_deg": [round(float(angle), 4) for angle in np.degrees(controller.arm.joints_at(robot_s))],
            "arm_temperature_c": round(controller.arm.temperature_c(robot_s), 2),
            "moving": controller.arm.is_moving_at(robot_s),
            "in_position": bool(flags & Flag.IN_POSITION),
            "armed": controller.armed,
            "moves_commanded": controller.moves_accepted,
            "departures": controller.arm.departures,
            "session": controller.session,
            "mode": controller.panel.mode.value,
            "motors_on": controller.panel.motors_on,
            "emergency_stop": controller.panel.emergency_stop,
            "program_running": controller.panel.program_running,
            "speed_override": controller.panel.speed_override,
            "faults": sorted(self.faults.active),
        }

    def _list_faults(self, fields: Fields) -> Any:
        return [
            {"name": fault.name, "area": fault.area, "summary": fault.summary, "on": fault.name in self.faults.active}
            for fault in self.faults.table.values()
        ]

    def _fault_on(self, fields: Fields) -> Any:
        only = fields.get("only")
        self.faults.switch_on(
            fields["name"],
            self.controller,
            self.clock(),
            strikes=_count(fields, "strikes"),
            only=None if only is None else _command(str(only)),
            after_moves=_count(fields, "after_moves") or 0,
        )
        return {"on": sorted(self.faults.active)}

    def _fault_off(self, fields: Fields) -> Any:
        self.faults.clear(self.controller, self.clock(), fields.get("name"))
        return {"on": sorted(self.faults.active)}

    def _jog(self, fields: Fields) -> None:
        """Move the arm as an operator does with the joystick: to `joints_deg`, or to `base_T_flange`, `in_s` (1 s).

        Or, with `axis_beside`, the track (mm) or the turntable (degrees) beside it, at once.
        """
        controller, now_s = self.controller, self.clock()
        controller.tick(now_s)
        if controller.armed or controller.panel.emergency_stop or not controller.panel.motors_on:
            raise JogRefused("the arm is armed, its emergency stop is pressed or its motors are off")
        robot_s = controller.robot_s(now_s)
        if "axis_beside" in fields:
            controller.stand_axes(controller.mounting.axes_at(_number(fields["axis_beside"], "axis_beside", -1e4, 1e4)))
            return
        in_s = _number(fields.get("in_s", 1.0), "in_s", *JOG_S)
        try:
            controller.arm.jog(self._jog_goal(fields, robot_s), in_s * controller.time_scale, robot_s)
        except UnreachablePoseError as error:
            raise JogRefused(f"{error.what}: {error.fix}") from None

    def _jog_goal(self, fields: Fields, robot_s: float) -> Array:
        """The joints (6,) rad to jog to. Raises JogRefused, UnreachablePoseError."""
        arm = self.controller.arm
        try:
            if "joints_deg" in fields:
                joints: Array = np.radians(
                    [_number(angle, "joints_deg", -1000, 1000) for angle in fields["joints_deg"]]
                )
                if joints.shape != (len(arm.arm.lower_rad),):
                    raise ValueError(joints.shape)
                return joints
            pose = PoseDocument.model_validate(fields.get("base_T_flange"))
            return arm.arm.nearest(pose.transform(), arm.joints_at(robot_s))
        except (TypeError, ValueError, GeometryError):
            raise JogRefused("give joints_deg, one angle for each axis, or base_T_flange, a pose in mm") from None


_ROUTES: tuple[tuple[str, re.Pattern[str], Callable[[ControlPort, Fields], Any]], ...] = tuple(
    (method, re.compile(path), handler)
    for method, path, handler in (
        ("GET", "/state", lambda port, _: port._state()),
        ("GET", "/log", lambda port, _: [vars(entry) for entry in port.controller.log]),
        ("GET", "/faults", ControlPort._list_faults),
        ("POST", "/faults/(?P<name>[a-z0-9-]+)", ControlPort._fault_on),
        ("DELETE", "/faults/(?P<name>[a-z0-9-]+)", ControlPort._fault_off),
        ("DELETE", "/faults", ControlPort._fault_off),
        ("POST", "/motors", lambda port, f: port.controller.switch_motors(_switch(f, "on"), port.clock())),
        ("POST", "/mode",
         lambda port, f: port.controller.switch_mode(Mode.from_name(str(f.get("mode"))), port.clock())),
        ("POST", "/emergency-stop",
         lambda port, f: port.controller.press_emergency_stop(_switch(f, "pressed"), port.clock())),
        ("POST", "/program", lambda port, f: port.controller.run_program(_switch(f, "running"), port.clock())),
        ("POST", "/jog", ControlPort._jog),
        ("POST", "/restart", lambda port, _: port.controller.restart(port.clock())),
        ("POST", "/power-failure", lambda port, _: port.controller.fail_power(port.clock())),
        ("POST", "/pointer-to-main", lambda port, _: port.controller.move_pointer_to_main(port.clock())),
    )
)  # fmt: skip
"""Handlers by method and path; where one returns None, the answer is the state."""


def _fields(body: bytes) -> dict[str, Any]:
    try:
        document = json.loads(body or "{}")
    except ValueError as error:
        raise NoSuchState("request body", str(error), ("a JSON object",)) from error
    if not isinstance(document, dict):
        raise NoSuchState("request body", type(document).__name__, ("a JSON object",))
    return document


def _switch(fields: Fields, name: str) -> bool:
    value = str(fields.get(name)).lower()
    if value not in TRUE + FALSE:
        raise NoSuchState(name, fields.get(name), ("true", "false"))
    return value in TRUE


def _number(value: Any, name: str, low: float, high: float) -> float:
    number = float(value)
    if not low <= number <= high:
        raise JogRefused(f"{name} is {number:g}, which is not within {low:g} and {high:g}")
    return number


def _count(fields: Fields, name: str) -> int | None:
    value = fields.get(name)
    if value is None:
        return None
    if not str(value).isdecimal():
        raise NoSuchState(name, value, ("a whole number",))
    return int(value)


def _command(name: str) -> Command:
    try:
        return Command[name.upper()]
    except KeyError:
        raise NoSuchState("only", name, tuple(command.name for command in Command)) from None


def _problem(status: int, detail: str) -> tuple[int, Any]:
    return status, {"type": "about:blank", "status": status, "detail": detail}
