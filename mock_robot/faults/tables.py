"""Tables of named faults: of the controller, its links, RWS and EGM, and of camera and scanner."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import nan
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import Any

import numpy as np

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.cabinet.panel import Mode
from mock_robot.cabinet.wire_steps import Close, Pause, Reset, Send, WireStep
from mock_robot.faults.board import DeviceFault, Fault, Picture, Points, StateFault
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


def _set(name: str, value: float, ended: float) -> tuple[StateFault, StateFault]:
    """Set an attribute of the controller or its panel, and set it to `ended` afterwards."""

    def turn(to: float) -> StateFault:
        return lambda c, now_s: setattr(c if hasattr(c, name) else c.panel, name, to)

    return turn(value), turn(ended)


def _wrong_pose(name: str, summary: str, change: Callable[[Pose], Pose]) -> Fault:
    """A fault that changes every pose, and nothing else."""
    return Fault(name, summary, None, reply=lambda reply: change(reply) if isinstance(reply, Pose) else reply)


def _scale(values: Any, factor: float) -> Any:
    return tuple(factor * value for value in values)


def _clock_jump(reply: Reply) -> Reply:
    return replace(reply, t_ms=(reply.t_ms + 3_600_000) % 8_000_000) if isinstance(reply, Pose | Report) else reply


_OF_SERVICES: dict[str, str] = json.loads(Path(__file__).with_name("service_faults.json").read_text("utf-8"))
_ROWS = (
    # --- the link, whatever carries it ---
    Fault("link-delay", f"every reply comes {DELAY_S} s late", None, send=lambda d, r: (Pause(DELAY_S), Send(d))),
    Fault("link-stall", f"one reply comes {STALL_S} s late", send=lambda d, r: (Pause(STALL_S), Send(d))),
    Fault("link-split", "every reply comes byte by byte", None, send=_split),
    Fault("link-drop-mid-frame", "half a reply, then closed", send=lambda d, r: (Send(_half(d)), Close())),
    Fault("link-close", "closed in place of a reply", send=lambda d, r: (Close(),)),
    Fault("link-reset", "reset in place of a reply", send=lambda d, r: (Reset(),)),
    Fault("link-half-open", "connected, but no bytes pass in either direction", None, receive=lambda d, r: b""),
    Fault("link-reply-lost", "the request is done, its reply is lost", send=lambda d, r: ()),
    Fault("link-deaf-once", "one piece of a request is lost on the way", receive=lambda d, r: b""),
    Fault("link-bit-flip", "one bit of a reply is flipped", send=lambda d, r: (Send(_flip(d, r)),)),
    Fault("link-request-bit-flip", "one bit of a request is flipped", receive=_flip),
    Fault("link-duplicate", "every reply comes twice", None, send=lambda d, r: (Send(d), Send(d))),
    Fault("link-request-duplicate", "every request comes twice", None, receive=lambda d, r: d + d),
    Fault("link-garbage", "garbage before a reply", send=lambda d, r: (Send(r.randbytes(23) + d),)),
    Fault("link-only-garbage", "garbage in place of every reply", None, send=lambda d, r: (Send(r.randbytes(40)),)),
    Fault("link-restart", "the controller restarts: a new session, disarmed", begin=lambda c, now_s: c.restart(now_s)),
    # --- the serial line ---
    Fault("serial-noise", "noise before every frame", None, send=lambda d, r: (Send(r.randbytes(7) + d),)),
    Fault("serial-half-frame", "half a frame, then silence", send=lambda d, r: (Send(_half(d)),)),
    Fault("serial-doubled-byte", "a byte comes twice", send=lambda d, r: (Send(_double_a_byte(d, r)),)),
    Fault("serial-break", "a break inside a frame", send=lambda d, r: (Send(_half(d) + b"\0" + d[len(d) // 2 :]),)),
    Fault("serial-magic-in-noise", "a false frame start before a frame", send=lambda d, r: (Send(b"\x43\x42" + d),)),
    # --- the robot ---
    Fault(
        "robot-emergency-stop",
        "the emergency stop is pressed",
        None,
        lambda c, now_s: c.press_emergency_stop(True, now_s),
        lambda c, now_s: c.press_emergency_stop(False, now_s),
    ),
    Fault(
        "robot-motors-off", "the motors lose power", None, lambda c, at_s: c.switch_motors(False, at_s), Cabinet.recover
    ),
    Fault(
        "robot-manual-mode",
        "somebody turns the key to manual full speed",
        None,
        lambda c, now_s: c.switch_mode(Mode.MANF, now_s),
        Cabinet.recover,
    ),
    Fault(
        "robot-program-stopped",
        "the motion program is stopped at the pendant",
        None,
        lambda c, now_s: c.run_program(False, now_s),
        lambda c, now_s: c.run_program(True, now_s),
    ),
    Fault("robot-not-settled", "the arm never reports standstill", None, *_set("settles", False, True)),
    Fault(
        "robot-override-zero", "speed override 0: moves begin and go nowhere", None, *_set("speed_override", 0.0, 1.0)
    ),
    _wrong_pose("robot-nan-pose", "a pose with NaN", lambda p: replace(p, position_mm=(nan, nan, nan))),
    _wrong_pose(
        "robot-quaternion-not-unit",
        "a quaternion of length 0.9",
        lambda p: replace(p, quaternion_wxyz=_scale(p.quaternion_wxyz, 0.9)),
    ),
    _wrong_pose("robot-metres", "positions in metres", lambda p: replace(p, position_mm=_scale(p.position_mm, 1e-3))),
    _wrong_pose(
        "robot-quaternion-xyzw",
        "the scalar part comes last",
        lambda p: replace(p, quaternion_wxyz=(*p.quaternion_wxyz[1:], p.quaternion_wxyz[0])),
    ),
    _wrong_pose(
        "robot-wrong-configuration",
        "poses carry another configuration than the arm's",
        lambda p: replace(p, configuration=(*p.configuration[:3], p.configuration[3] ^ 2)),
    ),
    Fault("robot-clock-jump", "the controller's clock is an hour ahead", None, reply=_clock_jump),
    # --- Robot Web Services and EGM: queried by name in mock_robot.rws and mock_robot.devices.egm ---
    *(Fault(name, summary, None) for name, summary in _OF_SERVICES.items()),
)

FAULTS: Mapping[str, Fault] = MappingProxyType({row.name: row for row in _ROWS})

LATE_S = 5.0


def _tear(picture: Picture) -> Picture:
    """Shift the lower half by a sixteenth of the width, as a readout that lost synchronisation does."""
    torn = picture.copy()
    half = len(picture) // 2
    torn[half:] = np.roll(picture[half:], picture.shape[1] // 16, axis=1)
    return torn


def _with_holes(points: Points) -> Points:
    """Set every tenth point to NaN, as scanners mark pixels without a measurement."""
    holes = points.copy()
    holes[::10] = np.nan
    return holes


_DEVICE_ROWS = (
    DeviceFault("camera-late", f"the picture comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("camera-away", "the camera answers 503", status=503),
    DeviceFault("camera-repeated", "the previous picture comes again as if new", None, repeats="lying"),
    DeviceFault("camera-stale", "the previous picture comes with its true age", None, repeats="honest"),
    DeviceFault("camera-black", "the picture is black", picture=np.zeros_like),
    DeviceFault("camera-saturated", "the picture is white", picture=lambda p: np.full_like(p, 255)),
    DeviceFault("camera-torn", "the lower half of the picture is shifted", picture=_tear),
    DeviceFault("camera-wrong-size", "the picture has half the size", picture=lambda p: p[::2, ::2].copy()),
    DeviceFault("camera-half-file", "half of the file comes", content=_half),
    DeviceFault("camera-empty-file", "a file of 0 bytes comes", content=lambda content: b""),
    DeviceFault("camera-target-hidden", "something covers the target", hides_target=True),
    DeviceFault("scanner-late", f"the cloud comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("scanner-away", "the scanner answers 503", status=503),
    DeviceFault("scanner-repeated", "the previous cloud comes again as if new", None, repeats="lying"),
    DeviceFault("scanner-stale", "the previous cloud comes with its true age", None, repeats="honest"),
    DeviceFault("scanner-empty", "the cloud has no points", points=lambda points: points[:0]),
    DeviceFault("scanner-nan", "every tenth point is NaN", points=_with_holes),
    DeviceFault("scanner-half-file", "half of the file comes", content=_half),
)

DEVICE_FAULTS: Mapping[str, DeviceFault] = MappingProxyType({fault.name: fault for fault in _DEVICE_ROWS})
