"""Table of named faults of the controller, its links, RWS and EGM. Camera and scanner have a table of their own."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import nan
from random import Random
from types import MappingProxyType
from typing import Any

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.cabinet.panel import Mode
from mock_robot.cabinet.wire_steps import Close, Pause, Reset, Send, WireStep
from mock_robot.faults.board import Fault, ReplyFault, StateFault
from protocols.cb.messages import Pose, Reply, Report

DELAY_S = 0.4
STALL_S = 3.0
"""Longer than the heartbeat's limit."""


def _split(data: bytes, random: Random) -> tuple[WireStep, ...]:
    steps: list[WireStep] = []
    for byte in data:
        steps += [Send(bytes([byte])), Pause(0.0005)]
    return tuple(steps)


def _flip(data: bytes, random: Random) -> bytes:
    if not data:  # another fault has dropped the bytes
        return data
    place = random.randrange(2, len(data)) if len(data) > 2 else 0
    return data[:place] + bytes([data[place] ^ (1 << random.randrange(8))]) + data[place + 1 :]


def _double_a_byte(data: bytes, random: Random) -> bytes:
    if not data:
        return data
    place = random.randrange(len(data))
    return data[: place + 1] + data[place:]


def _half(data: bytes) -> bytes:
    return data[: len(data) // 2]


def _set_attribute(name: str, value: float) -> StateFault:
    """Set an attribute of the controller or its panel."""

    def turn(controller: Cabinet, now_s: float) -> None:
        setattr(controller if hasattr(controller, name) else controller.panel, name, value)

    return turn


def _alter_pose(change: Callable[[Pose], Pose]) -> ReplyFault:
    """Apply `change` to poses only."""
    return lambda reply: change(reply) if isinstance(reply, Pose) else reply


def _scale(values: Any, factor: float) -> Any:
    return tuple(factor * value for value in values)


def _clock_jump(reply: Reply) -> Reply:
    return replace(reply, t_ms=(reply.t_ms + 3_600_000) % 8_000_000) if isinstance(reply, Pose | Report) else reply


_ROWS = (
    # --- the link, whatever carries it ---
    Fault(
        "link-delay", "link", f"every reply comes {DELAY_S} s late", None, send=lambda d, r: (Pause(DELAY_S), Send(d))
    ),
    Fault("link-stall", "link", f"one reply comes {STALL_S} s late", send=lambda d, r: (Pause(STALL_S), Send(d))),
    Fault("link-split", "link", "every reply comes byte by byte", None, send=_split),
    Fault("link-drop-mid-frame", "link", "half a reply, then closed", send=lambda d, r: (Send(_half(d)), Close())),
    Fault("link-close", "link", "closed in place of a reply", send=lambda d, r: (Close(),)),
    Fault("link-reset", "link", "reset in place of a reply", send=lambda d, r: (Reset(),)),
    Fault("link-half-open", "link", "connected, but no bytes pass in either direction", None, receive=lambda d, r: b""),
    Fault("link-reply-lost", "link", "the request is done, its reply is lost", send=lambda d, r: ()),
    Fault("link-deaf-once", "link", "one piece of a request is lost on the way", receive=lambda d, r: b""),
    Fault("link-bit-flip", "link", "one bit of a reply is flipped", send=lambda d, r: (Send(_flip(d, r)),)),
    Fault("link-request-bit-flip", "link", "one bit of a request is flipped", receive=_flip),
    Fault("link-duplicate", "link", "every reply comes twice", None, send=lambda d, r: (Send(d), Send(d))),
    Fault("link-request-duplicate", "link", "every request comes twice", None, receive=lambda d, r: d + d),
    Fault("link-garbage", "link", "garbage before a reply", send=lambda d, r: (Send(r.randbytes(23) + d),)),
    Fault(
        "link-only-garbage", "link", "garbage in place of every reply", None, send=lambda d, r: (Send(r.randbytes(40)),)
    ),
    Fault(
        "link-restart",
        "link",
        "the controller restarts: a new session, disarmed",
        begin=lambda c, now_s: c.restart(now_s),
    ),
    # --- the serial line ---
    Fault("serial-noise", "serial", "noise before every frame", None, send=lambda d, r: (Send(r.randbytes(7) + d),)),
    Fault("serial-half-frame", "serial", "half a frame, then silence", send=lambda d, r: (Send(_half(d)),)),
    Fault("serial-doubled-byte", "serial", "a byte comes twice", send=lambda d, r: (Send(_double_a_byte(d, r)),)),
    Fault(
        "serial-break",
        "serial",
        "a break inside a frame",
        send=lambda d, r: (Send(_half(d) + b"\0" + d[len(d) // 2 :]),),
    ),
    Fault(
        "serial-magic-in-noise",
        "serial",
        "a false frame start before a frame",
        send=lambda d, r: (Send(b"\x43\x42" + d),),
    ),
    # --- the robot ---
    Fault(
        "robot-emergency-stop",
        "robot",
        "the emergency stop is pressed",
        None,
        begin=lambda c, now_s: c.press_emergency_stop(True, now_s),
        end=lambda c, now_s: c.press_emergency_stop(False, now_s),
    ),
    Fault(
        "robot-motors-off",
        "robot",
        "the motors lose power",
        None,
        begin=lambda c, now_s: c.switch_motors(False, now_s),
        end=lambda c, now_s: c.recover(now_s),
    ),
    Fault(
        "robot-manual-mode",
        "robot",
        "somebody turns the key to manual full speed",
        None,
        begin=lambda c, now_s: c.switch_mode(Mode.MANF, now_s),
        end=lambda c, now_s: c.recover(now_s),
    ),
    Fault(
        "robot-program-stopped",
        "robot",
        "the motion program is stopped at the pendant",
        None,
        begin=lambda c, now_s: c.run_program(False, now_s),
        end=lambda c, now_s: c.run_program(True, now_s),
    ),
    Fault(
        "robot-not-settled",
        "robot",
        "the arm never reports standstill",
        None,
        _set_attribute("settles", False),
        _set_attribute("settles", True),
    ),
    Fault(
        "robot-override-zero",
        "robot",
        "speed override 0: moves begin and go nowhere",
        None,
        _set_attribute("speed_override", 0.0),
        _set_attribute("speed_override", 1.0),
    ),
    Fault(
        "robot-nan-pose",
        "robot",
        "a pose with NaN",
        None,
        reply=_alter_pose(lambda p: replace(p, position_mm=(nan, nan, nan))),
    ),
    Fault(
        "robot-quaternion-not-unit",
        "robot",
        "a quaternion of length 0.9",
        None,
        reply=_alter_pose(lambda p: replace(p, quaternion_wxyz=_scale(p.quaternion_wxyz, 0.9))),
    ),
    Fault(
        "robot-metres",
        "robot",
        "positions in metres",
        None,
        reply=_alter_pose(lambda p: replace(p, position_mm=_scale(p.position_mm, 1e-3))),
    ),
    Fault(
        "robot-quaternion-xyzw",
        "robot",
        "the scalar part comes last",
        None,
        reply=_alter_pose(lambda p: replace(p, quaternion_wxyz=(*p.quaternion_wxyz[1:], p.quaternion_wxyz[0]))),
    ),
    Fault(
        "robot-wrong-configuration",
        "robot",
        "poses carry another configuration than the arm's",
        None,
        reply=_alter_pose(lambda p: replace(p, configuration=(*p.configuration[:3], p.configuration[3] ^ 2))),
    ),
    Fault("robot-clock-jump", "robot", "the controller's clock is an hour ahead", None, reply=_clock_jump),
    # --- Robot Web Services and EGM: queried by name in mock_robot.rws and mock_robot.devices.egm ---
    Fault("rws-401", "rws", "every RWS request is answered 401, and all sessions end", None),
    Fault("rws-406", "rws", "every RWS request is answered 406 whatever its media type", None),
    Fault("rws-503", "rws", "every RWS request is answered 503", None),
    Fault("rws-410", "rws", "mastership answers 410, as RobotWare 8 does", None),
    Fault("rws-slow", "rws", "every RWS answer comes 1 s late", None),
    Fault("rws-garbage", "rws", "every RWS answer is cut off", None),
    Fault("rws-sessions-exhausted", "rws", "other clients hold all 70 sessions", None),
    Fault("rws-mastership-held", "rws", "the pendant holds the mastership of everything", None),
    Fault("rws-subscription-gone", "rws", "subscriptions send no more events; their sockets stay open", None),
    Fault("egm-silent", "egm", "no EGM packet comes any more", None),
    Fault("egm-loss", "egm", "every fifth EGM packet is lost", None),
    Fault("egm-garbage", "egm", "EGM packets are cut off", None),
    Fault("egm-vibration", "egm", "EGM reports the flange vibrating by 0.3 mm at 12 Hz", None),
    Fault("rws-other-tool", "rws", "another tool and work object are selected at the pendant", None),
)

FAULTS: Mapping[str, Fault] = MappingProxyType({row.name: row for row in _ROWS})
