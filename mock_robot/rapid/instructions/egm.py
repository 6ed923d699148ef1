"""Externally Guided Motion: identities, devices, streams, and the arm guided by a sensor's corrections."""

from types import MappingProxyType
from typing import Any

import numpy as np

from calibration.kinematics.arm import UnreachablePoseError
from calibration.transforms import Array, transform
from mock_robot.arm.paths import LinePath
from mock_robot.rapid.errors import ProgramStopped, RapidError
from mock_robot.rapid.guidance import PERIOD_S, EgmSession, guide_joints, guide_pose
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.instructions.motion import NEAR_SINGULARITY, OUTSIDE_REACH, own_unit
from mock_robot.rapid.postures import flange_of, matrix_of, world_T_object
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask

MAX_IDENTITIES = 4
"""A controller has four EGM processes; one that is not reset stays taken."""
MIN_SAMPLE_MS = 4.0
BASE, TOOL, WOBJ, WORLD, JOINT = range(5)
RAMP_DOWN = 1.0
DISCONNECTED, CONNECTED, RUNNING = 0.0, 1.0, 2.0
CONDITION_S = 1.0
WITHIN = (-0.5, 0.5)
"""Convergence criteria as delivered: degrees or mm."""


def reset(task: ProgramTask, identity: Slot) -> None:
    """No error for one that was never taken."""
    session = task.services.unit.egm.pop(id(identity), None)
    if session is not None:
        session.end()


def get_id(task: ProgramTask, identity: Slot) -> None:
    sessions = task.services.unit.egm
    if len(sessions) >= MAX_IDENTITIES and id(identity) not in sessions:
        raise RapidError("ERR_UDPUC_COMM", "every EGM identity is taken: EGMReset releases one")
    sessions.setdefault(id(identity), EgmSession(task.services.unit, task.services.unit.clock))


def state_of(task: ProgramTask, identity: Slot) -> float:
    session = task.services.unit.egm.get(id(identity))
    if session is None or session.state == "taken":
        return DISCONNECTED
    return RUNNING if session.state == "runs" else CONNECTED


def setup_uc(
    task: ProgramTask,
    unit: Any,
    identity: Slot,
    configuration: str,
    device: str,
    joint: bool | None,
    pose: bool | None,
    path: bool | None,
    at_point: bool | None,
    look_ahead: bool | None,
    timeout_s: float | None,
) -> None:
    """The device is one of the configuration; it sends to its port on this machine, whatever its address."""
    devices = {name.casefold(): target for name, target in task.services.egm_devices.items()}
    name = device.removesuffix(":").casefold()
    if name not in devices:
        raise RapidError("ERR_UDPUC_COMM", f"no UDP unicast device is named {device}")
    session = _require_session(task, identity)
    session.end()
    session.state, session.target = "set up", devices[name]
    session.kind = "pose" if pose else "path" if path else "joint"
    session.timeout_s = 1.0 if timeout_s is None else timeout_s


def stream_start(task: ProgramTask, identity: Slot, sample_ms: float | None) -> None:
    session = _require_session(task, identity)
    if session.state == "taken":
        raise RapidError("ERR_UDPUC_COMM", "EGMSetupUC comes first")
    session.every = _periods(sample_ms)
    if session.state == "set up":
        session.state = "streams"
    session.begin()


def stream_stop(task: ProgramTask, identity: Slot) -> None:
    session = _require_session(task, identity)
    if session.state == "streams":
        session.state = "set up"
    if session.state == "set up":
        session.end()


def act_joint(task: ProgramTask, identity: Slot, streams: bool | None, *given: Any) -> None:
    tool, wobj, _load, *bounds, _filter_hz, sample_ms, deviation, speed = given
    session = _activate(task, identity, "joint", tool, wobj, sample_ms)
    session.settings |= {"within": _bounds(bounds[:6]), "max_deviation": deviation, "max_speed": speed}


def act_pose(task: ProgramTask, identity: Slot, streams: bool | None, *given: Any) -> None:
    tool, wobj, _load, correction, correction_kind, sensor, sensor_kind, *rest = given
    *bounds, _filter_hz, sample_ms, deviation, speed = rest
    session = _activate(task, identity, "pose", tool, wobj, sample_ms)
    session.settings |= {
        "within": _bounds(bounds),
        "max_deviation": deviation,
        "max_speed": speed,
        "world_T_correction": _frame(session, correction, correction_kind),
        "world_T_sensor": _frame(session, sensor, sensor_kind),
    }


def act_move(task: ProgramTask, identity: Slot, sensor: list[Any], sample_ms: float | None) -> None:
    _activate(task, identity, "path", None, None, sample_ms)


def run_joint(task: ProgramTask, identity: Slot, mode: float, at_once: bool | None, *given: Any) -> None:
    *axes, _seven, condition_s, _ramp_in_s, _ramp_out_s, _gain = given
    session = _require_active(task, identity, "joint")
    _run(task, session, guide_joints(session, [bool(axis) for axis in axes], session.settings["within"]))
    if not at_once:
        _wait(task, session, mode, condition_s)


def run_pose(task: ProgramTask, identity: Slot, mode: float, at_once: bool | None, *given: Any) -> None:
    *parts, condition_s, _ramp_in_s, _ramp_out_s, _offset, _gain = given
    session = _require_active(task, identity, "pose")
    _run(task, session, guide_pose(session, [bool(part) for part in parts], session.settings["within"]))
    if not at_once:
        _wait(task, session, mode, condition_s)


def stop(task: ProgramTask, identity: Slot, mode: float, ramp_out_s: float | None) -> None:
    """Where it is, or with EGM_STOP_RAMP_DOWN back where it began."""
    _finish(task, _require_session(task, identity), mode)


def move_l(task: ProgramTask, identity: Slot, target: list[Any], *given: Any) -> None:
    """A line whose points the sensor shifts across the path: y, z of the path's frame."""
    speed, _zone, tool, wobj, _load, no_corrections = given
    joints = _reach(task, target, tool, wobj)
    unit = own_unit(task)
    path = LinePath(unit.arm, unit.joints_now(), joints)
    _follow_path(task, None if no_corrections else _require_session(task, identity), path, speed[0])


def _reach(task: ProgramTask, target: list[Any], tool: Slot, wobj: Slot | None) -> Array:
    unit = own_unit(task)
    flange = flange_of(target, tool.value, None if wobj is None else wobj.value)
    try:
        joints: Array = unit.joints_for(flange, target[2], target[3])
    except UnreachablePoseError as error:
        raise ProgramStopped(OUTSIDE_REACH, task.name, error.what) from error
    return joints


def _follow_path(task: ProgramTask, session: EgmSession | None, path: LinePath, speed_mm_s: float) -> None:
    unit = own_unit(task)
    points = np.array([path.base_T_flange_at(along)[:3, 3] for along in np.linspace(0.0, 1.0, 25)])
    length_mm = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    steps = max(1, int(np.ceil(length_mm / max(speed_mm_s, 1e-3) / (PERIOD_S * unit.time_scale))))
    for step in range(1, steps + 1):
        wait_for(task, lambda: not (unit.held or unit.stopped_by))
        pose = path.base_T_flange_at(step / steps)
        if session is not None and session.newest is not None and len(session.newest.across_path_mm) == 3:
            pose = _shift_across(path, step / steps, pose, np.array(session.newest.across_path_mm))
        try:
            joints = unit.arm.nearest(pose, unit.joints_now())
        except UnreachablePoseError as error:
            raise ProgramStopped(NEAR_SINGULARITY, task.name, error.what) from error
        unit.cabinet.arm.guide(joints, PERIOD_S * unit.time_scale, unit.now_s())
        task.wait(PERIOD_S)


def _shift_across(path: LinePath, along: float, pose: Array, across_mm: Array) -> Array:
    """Path frame: x along the path, z that of the tool made square to it."""
    ahead = path.base_T_flange_at(min(along + 0.01, 1.0))[:3, 3] - path.base_T_flange_at(along - 0.01)[:3, 3]
    x = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    z = pose[:3, 2] - (pose[:3, 2] @ x) * x
    z = z / max(float(np.linalg.norm(z)), 1e-9)
    return transform(pose[:3, :3], pose[:3, 3] + across_mm[1] * np.cross(z, x) + across_mm[2] * z)


def _activate(
    task: ProgramTask, identity: Slot, kind: str, tool: Slot | None, wobj: Slot | None, sample_ms: float | None
) -> EgmSession:
    own_unit(task)
    session = _require_session(task, identity)
    if session.state == "taken" or session.kind != kind:
        raise RapidError("ERR_UDPUC_COMM", f"EGMSetupUC with \\{kind} comes first")
    session.every, session.state = _periods(sample_ms), "activated"
    session.settings = {
        "flange_T_tool": np.eye(4) if tool is None else matrix_of(tool.value[1]),
        "world_T_object": np.eye(4) if wobj is None else world_T_object(wobj.value),
    }
    session.begin()
    return session


def _require_active(task: ProgramTask, identity: Slot, kind: str) -> EgmSession:
    session = _require_session(task, identity)
    if session.state not in ("activated", "runs") or session.kind != kind:
        raise RapidError("ERR_UDPUC_COMM", f"EGMAct{kind.title()} comes first")
    return session


def _run(task: ProgramTask, session: EgmSession, guide: Any) -> None:
    session.newest, session.settled_since_s, session.failed = None, None, ""
    session.guide, session.state = guide, "runs"
    session.begin()


def _wait(task: ProgramTask, session: EgmSession, mode: float, condition_s: float | None) -> None:
    """Until what is left lies within the bounds for the time. Raises ERR_UDPUC_COMM when the sensor falls silent."""
    unit, holds_s = session.unit, CONDITION_S if condition_s is None else condition_s

    def is_over() -> bool:
        if session.failed:
            raise ProgramStopped(OUTSIDE_REACH, task.name, session.failed)
        if session.is_silent:
            session.guide, session.state = None, "activated"
            raise RapidError("ERR_UDPUC_COMM", "the sensor sends nothing")
        since_s = session.settled_since_s
        return session.guide is None or (since_s is not None and unit.now_s() - since_s >= holds_s)

    wait_for(task, is_over, poll_s=PERIOD_S)
    _finish(task, session, mode)


def _finish(task: ProgramTask, session: EgmSession, mode: float) -> None:
    guide, session.guide = session.guide, None
    if session.state == "runs":
        session.state = "activated"
    if guide is not None and mode == RAMP_DOWN:
        unit = session.unit
        unit.order(guide.start, 250.0, guide.max_speed_rad_s, linear=False)
        task.wait(unit.arrives_in_s(), until=unit.has_arrived)


def _frame(session: EgmSession, pose: list[Any], kind: float) -> Any:
    """The frame (4, 4) in the world, given where the tool is when the arm begins to be guided."""
    frame, base = matrix_of(pose), session.unit.cabinet.world_T_base
    fixed = {BASE: base, WOBJ: session.settings["world_T_object"], WORLD: np.eye(4)}.get(int(kind))
    if fixed is None and int(kind) != TOOL:
        raise RapidError("ERR_ARGVALERR", "the mock has no frames of joints")
    return lambda world_T_tool: (world_T_tool if fixed is None else fixed) @ frame


def _bounds(given: list[Any]) -> list[tuple[float, float]]:
    return [WITHIN if each is None else (each[0], each[1]) for each in given]


def _periods(sample_ms: float | None) -> int:
    if sample_ms is not None and (sample_ms < MIN_SAMPLE_MS or sample_ms % MIN_SAMPLE_MS):
        raise RapidError("ERR_ARGVALERR", "a sample rate is a multiple of 4 ms")
    return 1 if sample_ms is None else int(sample_ms / MIN_SAMPLE_MS)


def _require_session(task: ProgramTask, identity: Slot) -> EgmSession:
    session: EgmSession | None = task.services.unit.egm.get(id(identity))
    if session is None:
        raise RapidError("ERR_UDPUC_COMM", "EGMGetId comes first")
    return session


DOES = MappingProxyType(
    {
        "EGMReset": reset,
        "EGMGetId": get_id,
        "EGMGetState": state_of,
        "EGMSetupUC": setup_uc,
        "EGMStreamStart": stream_start,
        "EGMStreamStop": stream_stop,
        "EGMActJoint": act_joint,
        "EGMActPose": act_pose,
        "EGMActMove": act_move,
        "EGMRunJoint": run_joint,
        "EGMRunPose": run_pose,
        "EGMStop": stop,
        "EGMMoveL": move_l,
    }
)
