"""Externally Guided Motion: identities, devices, streams, and the arm guided by a sensor's corrections."""

from types import MappingProxyType
from typing import Any

import numpy as np

from calibration.kinematics.arm import UnreachablePoseError
from calibration.transforms import Array, transform
from mock_robot.arm.paths import LinePath
from mock_robot.rapid.errors import ProgramStopped, RapidError
from mock_robot.rapid.guidance import PERIOD_S, EgmSession, Target, guide_joints, guide_pose
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.instructions.motion import NEAR_SINGULARITY, joints_of, own_unit
from mock_robot.rapid.postures import matrix_of, world_T_object
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask

MAX_IDENTITIES = 4
"""A controller has four EGM processes; one that is not reset stays taken."""
MIN_SAMPLE_MS = 4.0
WOBJ, HOLD = 2.0, 0.0
"""EGM_FRAME_WOBJ and EGM_STOP_HOLD: the mock does no other frame, and no ramp back to where guidance began."""
DISCONNECTED, CONNECTED, RUNNING = 0.0, 1.0, 2.0


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
    tool, wobj, _load, *_within, _filter_hz, sample_ms, deviation, speed = given
    session = _activate(task, identity, "joint", tool, wobj, sample_ms)
    session.settings |= {"max_deviation": deviation, "max_speed": speed}


def act_pose(task: ProgramTask, identity: Slot, streams: bool | None, *given: Any) -> None:
    tool, wobj, _load, correction, correction_kind, sensor, sensor_kind, *rest = given
    *_within, _filter_hz, sample_ms, deviation, speed = rest
    if (correction_kind, sensor_kind) != (WOBJ, WOBJ):
        raise RapidError("ERR_ARGVALERR", "the mock has frames of corrections in the work object only")
    session = _activate(task, identity, "pose", tool, wobj, sample_ms)
    world_T_object = session.settings["world_T_object"]
    session.settings |= {
        "max_deviation": deviation,
        "max_speed": speed,
        "world_T_correction": world_T_object @ matrix_of(correction),
        "world_T_sensor": world_T_object @ matrix_of(sensor),
    }


def act_move(task: ProgramTask, identity: Slot, sensor: list[Any], sample_ms: float | None) -> None:
    _activate(task, identity, "path", None, None, sample_ms)


def run_joint(task: ProgramTask, identity: Slot, mode: float, at_once: bool | None, *given: Any) -> None:
    *axes, _seven, _condition_s, _ramp_in_s, _ramp_out_s, _gain = given
    session = _require_active(task, identity, "joint", mode, at_once)
    _run(session, guide_joints(session, [bool(axis) for axis in axes]))


def run_pose(task: ProgramTask, identity: Slot, mode: float, at_once: bool | None, *given: Any) -> None:
    *parts, _condition_s, _ramp_in_s, _ramp_out_s, _offset, _gain = given
    session = _require_active(task, identity, "pose", mode, at_once)
    _run(session, guide_pose(session, [bool(part) for part in parts]))


def stop(task: ProgramTask, identity: Slot, mode: float, ramp_out_s: float | None) -> None:
    """The arm stays where it is."""
    session = _require_session(task, identity)
    _require_hold(mode)
    session.guide = None
    if session.state == "runs":
        session.state = "activated"


def move_l(task: ProgramTask, identity: Slot, target: list[Any], *given: Any) -> None:
    """A line whose points the sensor shifts across the path: y, z of the path's frame."""
    speed, _zone, tool, wobj, _load, no_corrections = given
    joints = joints_of(task, target, tool, wobj)
    unit, session = own_unit(task), None if no_corrections else _require_session(task, identity)
    path = LinePath(unit.arm, unit.joints_now(), joints)
    points = np.array([path.base_T_flange_at(along)[:3, 3] for along in np.linspace(0.0, 1.0, 25)])
    length_mm = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    steps = max(1, int(np.ceil(length_mm / max(speed[0], 1e-3) / (PERIOD_S * unit.time_scale))))
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


def _require_active(task: ProgramTask, identity: Slot, kind: str, mode: float, at_once: bool | None) -> EgmSession:
    session = _require_session(task, identity)
    if session.state not in ("activated", "runs") or session.kind != kind:
        raise RapidError("ERR_UDPUC_COMM", f"EGMAct{kind.title()} comes first")
    if not at_once:
        raise RapidError("ERR_ARGVALERR", "the mock guides with \\NoWaitCond only, until EGMStop")
    _require_hold(mode)
    return session


def _require_hold(mode: float) -> None:
    if mode != HOLD:
        raise RapidError("ERR_ARGVALERR", "the mock ends guidance with EGM_STOP_HOLD only")


def _run(session: EgmSession, guide: Target) -> None:
    session.newest, session.start = None, session.unit.joints_now()
    session.guide, session.state = guide, "runs"
    session.begin()


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
