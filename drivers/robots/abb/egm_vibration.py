"""Measures the flange's vibration from EGM feedback at 250 Hz. It never sends anything.

The controller is the client: while its program streams, it sends to the port configured in its SIO.
"""

import os
import socket
import struct
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import hypot, isfinite

import numpy as np

from calibration.transforms import Array, transform_from_quaternion
from drivers.clock_mapping import ClockMapping
from drivers.errors import DeviceTimeout, DeviceUnreachable
from drivers.interfaces import LinkHealth, Vibration
from drivers.link_status import LinkReport
from drivers.timing import Timing, shorten_switch_interval
from drivers.transports.late_address import allow_late_address
from protocols.egm.messages import RobotSample, decode
from protocols.egm.protobuf import NotEgm

MAX_SAMPLES = 2500
"""Ten seconds of samples."""
POLL_S = 0.2
SILENT_AFTER_S = 0.5
MIN_SAMPLES = 5
MIN_NORM = 0.5
"""Least norm of a quaternion; a controller's are 1."""
MAX_REASONS = 16
"""Reasons for which packets are counted apart; senders may be many."""
SEQNO_COUNT = 2**32
SO_TIMESTAMPNS = 35
"""linux/asm-generic/socket.h: the kernel time-stamps each packet, independent of when this thread runs."""
CLOCK_TRIES, CLOCK_STEP_S = 5, 1e-4
_TIMESPEC = _TIMEVAL = struct.Struct("@ll")
STREAMS = "check that the program runs EGMStreamStart, and the address and port in the controller's SIO (UDPUC)"


@dataclass(frozen=True, slots=True)
class ReceivedSample:
    """A sample, and the time its packet arrived by this machine's clock."""

    received_at_s: float
    sample: RobotSample


class SampleWindow:
    """The newest samples in the controller's order. Late and repeated ones are dropped."""

    def __init__(self) -> None:
        self._arrivals: deque[ReceivedSample] = deque(maxlen=MAX_SAMPLES)

    @property
    def newest(self) -> ReceivedSample | None:
        return self._arrivals[-1] if self._arrivals else None

    def add(self, arrival: ReceivedSample) -> bool:
        """Add a sample; returns whether it is newer than all before. After a silence any number starts a new window."""
        if (newest := self.newest) is not None:
            ahead = (arrival.sample.seqno - newest.sample.seqno) % SEQNO_COUNT
            if arrival.received_at_s - newest.received_at_s > SILENT_AFTER_S:
                self._arrivals.clear()
            elif not 0 < ahead < SEQNO_COUNT // 2:
                return False
        self._arrivals.append(arrival)
        return True

    def since(self, time_s: float) -> list[ReceivedSample]:
        """Samples since `time_s`, oldest first."""
        return [arrival for arrival in list(self._arrivals) if arrival.received_at_s >= time_s]


class EgmMonitor:
    """Listens in a thread of its own, so that other work in the process delays it little."""

    def __init__(self, host: str, port: int, robot: str | None = None, timing: Timing | None = None) -> None:
        """Packets come to `host` and `port`; `robot`: the only accepted sender, when one is named."""
        self._host, self._port, self._robot, self._timing = host, port, robot, timing or Timing()
        self._device = f"EGM udp://{host}:{port}"
        self._report = LinkReport(self._timing.clock)
        self._window = SampleWindow()
        self._ending = threading.Event()
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._unused: Counter[str] = Counter()

    @property
    def strangers(self) -> int:
        """Packets that were not used."""
        return self._unused.total()

    @property
    def link(self) -> LinkHealth:
        newest = self._window.newest
        if newest is not None and self._timing.clock() - newest.received_at_s <= SILENT_AFTER_S:
            self._report.up("samples come")
        else:
            self._report.down(f"no sample for {SILENT_AFTER_S:g} s{self._packets_in_vain()}: {STREAMS}")
        return self._report.health

    @property
    def port(self) -> int:
        assert self._socket is not None
        return int(self._socket.getsockname()[1])

    def start(self) -> None:
        """Start listening, also at an address that comes later. Raises DeviceUnreachable when the port is taken."""
        listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            allow_late_address(listening)
            listening.bind((self._host, self._port))
        except OSError as error:
            listening.close()
            fix = "end the program that listens there, or correct host and port"
            raise DeviceUnreachable(self._device, f"cannot listen ({error})", fix) from error
        listening.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _TIMEVAL.pack(0, int(POLL_S * 1e6)))
        self._socket = listening
        self._thread = threading.Thread(target=self._listen, args=(listening,), name=self._device, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
        if self._socket is not None:
            self._socket.close()

    def arrivals(self, window_s: float) -> list[ReceivedSample]:
        """Samples of the last `window_s`, oldest first. Raises DeviceTimeout when there are too few."""
        recent = self._window.since(self._timing.clock() - window_s)
        if len(recent) < MIN_SAMPLES:
            what = f"{len(recent)} samples came within {window_s:g} s{self._packets_in_vain()}"
            raise DeviceTimeout(self._device, what, STREAMS)
        return recent

    def _packets_in_vain(self) -> str:
        """How many packets were not used, and why; that none came points to a firewall or another port."""
        if not self._unused:
            return ", and no other packet: a firewall, or another port"
        return "".join(f"; {count} packets {why}" for why, count in self._unused.most_common(3))

    def vibration(self, window_s: float) -> Vibration:
        """Deviation of the flange within the last `window_s`. Raises DeviceTimeout."""
        return vibration_of([arrival.sample for arrival in self.arrivals(window_s)])

    def _listen(self, listening: socket.socket) -> None:
        # Real-time priority, where allowed (RLIMIT_RTPRIO): the thread works 0.2 ms of every 4 ms.
        shorten_switch_interval()
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        clock = self._timing.clock
        while not self._ending.is_set():
            try:
                data, notes, _, sender = listening.recvmsg(2048, 64)
            except BlockingIOError:
                continue  # for POLL_S: waiting in the kernel takes the interpreter lock only once per packet
            except OSError:
                return  # closed
            if self._robot not in (None, sender[0]):
                self._count(f"from {sender[0]}, expected {self._robot}")
                continue
            try:
                sample = decode(data)
            except NotEgm as unusable:
                self._count(f"from {sender[0]} {unusable.why}")
                continue
            if not (isfinite(sum(sample.position_mm)) and MIN_NORM < hypot(*sample.quaternion_wxyz) < 1 / MIN_NORM):
                self._count(f"from {sender[0]} whose pose is none: NaN, or a quaternion of zeros")
                continue
            self._window.add(ReceivedSample(_arrival_time_s(notes, clock), sample))

    def _count(self, why: str) -> None:
        if why in self._unused or len(self._unused) < MAX_REASONS:
            self._unused[why] += 1


def vibration_of(samples: list[RobotSample]) -> Vibration:
    """Largest distance and largest angle from the mean."""
    positions = np.array([sample.position_mm for sample in samples])
    quaternions = np.array([sample.quaternion_wxyz for sample in samples])
    quaternions *= np.where(quaternions @ quaternions[0] < 0, -1.0, 1.0)[:, None]
    mean = quaternions.mean(axis=0)
    mean /= np.linalg.norm(mean)
    away = np.linalg.norm(quaternions - np.outer(quaternions @ mean, mean), axis=1)  # sine of half the angle
    return Vibration(
        translation_mm=float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max()),
        rotation_rad=float(2 * np.arcsin(min(float(away.max()), 1.0))),
        samples=len(samples),
        lost=(samples[-1].seqno - samples[0].seqno + 1) - len(samples),
    )


def _arrival_time_s(notes: list[tuple[int, int, bytes]], clock: Callable[[], float]) -> float:
    """Arrival time of the packet by `clock`, from the kernel's time stamp; now when there is none."""
    noted_s = _kernel_time_s(notes)
    for _ in range(CLOCK_TRIES):  # compares two clocks; repeated when another thread ran in between
        before_s, wall_s, after_s = clock(), time.time(), clock()
        if after_s - before_s < CLOCK_STEP_S:
            break
    age_s = 0.0 if noted_s is None else min(max(wall_s - noted_s, 0.0), 1.0)
    return before_s - age_s


def _kernel_time_s(notes: list[tuple[int, int, bytes]]) -> float | None:
    """The kernel's time stamp, wall time."""
    for level, kind, content in notes:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS and len(content) >= _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack_from(content)
            return float(seconds + nanoseconds * 1e-9)
    return None


LEARNING_S = 5.0
"""Samples of this time before the sweep give the offset of the clocks."""


class EgmPath:
    """drivers.interfaces.PathRecorder. The clocks' offset stays as it is at the start: 0.25 ms in 5 s at the most."""

    def __init__(self, monitor: EgmMonitor) -> None:
        """Raises DeviceTimeout when the controller sends nothing."""
        self._monitor, mapping = monitor, ClockMapping()
        for arrival in monitor.arrivals(LEARNING_S):
            mapping.note(_stamp_s(arrival), arrival.received_at_s)
            self._newest_s = arrival.received_at_s
        self._offset_s = mapping.offset_s

    async def read(self) -> tuple[Array, Array]:
        """Times (n,) in s of the driver's clock and world_T_flange (n, 4, 4) since the last call.

        Raises DeviceTimeout when the controller sends nothing.
        """
        new = [one for one in self._monitor.arrivals(SILENT_AFTER_S) if one.received_at_s > self._newest_s]
        if not new:
            return np.empty(0), np.empty((0, 4, 4))
        self._newest_s = new[-1].received_at_s
        times_s = np.array([_stamp_s(one) for one in new]) + self._offset_s
        positions = np.array([one.sample.position_mm for one in new])
        quaternions = np.array([one.sample.quaternion_wxyz for one in new])
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        return times_s, transform_from_quaternion(positions, quaternions)


def _stamp_s(arrival: ReceivedSample) -> float:
    """Time of a sample by the controller's clock: the finer one, where the controller sends it."""
    sample = arrival.sample
    return sample.time_us * 1e-6 if sample.time_us else sample.robot_ms * 1e-3
