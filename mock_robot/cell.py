"""The complete mock cell: truth, arm, controller, links, camera, scanner and control port."""

import json
import os
from collections.abc import Callable
from contextlib import AsyncExitStack
from dataclasses import astuple, dataclass, replace
from functools import partial
from pathlib import Path
from random import Random
from time import monotonic
from typing import Any, Literal

import numpy as np

from calibration.kinematics.abb_arms import find_any_arm
from calibration.kinematics.arm import Arm
from calibration.kinematics.load import Load
from calibration.kinematics.seven_axes import SevenAxisArm
from calibration.transforms import Array
from mock_robot.arm.built_arm import ScaraArm
from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.cabinet.cabinet import MotionBox
from mock_robot.control_port import ControlPort
from mock_robot.devices.egm import EgmSender
from mock_robot.devices.http_server import HttpServer
from mock_robot.errors import MockError
from mock_robot.faults.tables import DEVICE_FAULTS
from mock_robot.links.cb_program import CAMERA_LOAD
from mock_robot.links.wires import PythonWires, RapidWires, Wires
from mock_robot.rws.station import RwsStation, RwsUrls
from mock_robot.truth.start_posture import start_joints
from mock_robot.truth.truth import CellTruth
from mock_robot.truth.truth_sheet import cell_sheet
from protocols.cb.codes import Command


@dataclass(frozen=True)
class Announcement:
    """Addresses of all interfaces, and the cell sheet: what an integrator knows, nothing of the truth."""

    seed: int
    robot_host: str
    robot_port: int | None
    serial_path: str | None
    devices_url: str | None
    control_url: str
    sheet: dict[str, Any]
    rws: RwsUrls | None = None
    profiler: str | None = None
    cameras: tuple[str, ...] = ()
    scanners: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        return {
            "schema_version": 1,
            "seed": self.seed,
            "pid": os.getpid(),
            "robot": {"host": self.robot_host, "port": self.robot_port, "serial": self.serial_path},
            "camera": self._device("camera/snapshot.png"),
            "scanner": self._device("scanner/cloud.ply"),
            "cameras": {name: self._device(f"cameras/{name}/snapshot.png") for name in self.cameras},
            "scanners": {name: self._device(f"scanners/{name}/cloud.pcd") for name in self.scanners},
            "profiler": self.profiler,
            "rws": None if self.rws is None else {"1.0": self.rws.first, "2.0": self.rws.second},
            "control": self.control_url,
            "cell": self.sheet,
        }

    def _device(self, path: str) -> str | None:
        return None if self.devices_url is None else f"{self.devices_url}/{path}"

    def line(self) -> str:
        return json.dumps(self.document())

    def write(self, path: Path) -> None:
        """Write the line atomically: readers see the whole file or none."""
        unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        unfinished.write_text(self.line() + "\n")
        unfinished.replace(path)


LOOPBACK = "127.0.0.1"

RobotProgram = Literal["rapid", "python"]
"""Robot program behind the link: the shipped RAPID in the interpreter, or a fast equivalent in Python."""

_WIRES: dict[RobotProgram, type[PythonWires] | type[RapidWires]] = {"rapid": RapidWires, "python": PythonWires}


@dataclass(frozen=True)
class Ports:
    """Ports to listen on; 0: chosen by the system.

    `serial` opens a pty: beside the socket with the Python program, instead of it with RAPID, as on a real controller.
    `devices` None: no camera and scanner. `rws` None: no Robot Web Services, otherwise the ports of 1.0 and 2.0.
    `egm`: host and port to send EGM to. `profiler`: of a line profiler in the scanner's place; None: there is none.
    """

    host: str = LOOPBACK
    robot: int = 0
    devices: int | None = 0
    control: int = 0
    serial: bool = False
    rws: tuple[int, int] | None = None
    egm: tuple[str, int] | None = None
    profiler: int | None = None


class MockCell:
    """Owns all parts of the mock. Times come from `clock`. `home`: a folder whose RAPID runs in place of `program`."""

    def __init__(
        self,
        truth: CellTruth,
        *,
        time_scale: float = 1.0,
        session: int | None = None,
        clock: Callable[[], float] = monotonic,
        program: RobotProgram = "python",
        home: Path | None = None,
    ) -> None:
        arm = find_any_arm(truth.arm)
        if truth.scara and isinstance(arm, Arm):
            arm = ScaraArm(*astuple(arm))
        noise = ArmNoise(truth.noise.robot_translation_mm, np.radians(truth.noise.robot_rotation_deg), truth.seed)
        if isinstance(arm, SevenAxisArm) and (program != "python" or home is not None):
            raise MockError(f"{arm.name} has seven axes: only the Python program moves it, the interpreter moves six")
        self.truth, self.clock = truth, clock
        kind = _WIRES[program] if home is None else partial(RapidWires, home=home)
        self._wires: Wires = kind(
            SimulatedArm(arm, start_joints(arm, truth), noise, built=truth.built_arm(), load=Load(*CAMERA_LOAD)),
            clock,
            truth.seed,
            session=session or Random().randrange(1, 65536),
            time_scale=time_scale,
            started_at_s=clock(),
            box=MotionBox(*map(tuple, cell_sheet(truth)["box_mm"])),
        )
        self.controller = self._wires.controller
        self.controller.mounting = replace(truth.mounting)
        self.controller.stand_axes(truth.mounting.axes_at(0.0))
        self.faults = self._wires.board
        self.rws = RwsStation(self.controller, self.faults, clock)
        self.rws.world.equipment.arm = truth.arm
        self.egm = EgmSender(self.controller, self.faults, clock)
        self._closing = AsyncExitStack()

    async def start(self, ports: Ports) -> Announcement:
        self._closing.push_async_callback(self._wires.close)
        host, port, serial = await self._wires.start(ports.host, ports.robot, ports.serial)
        devices = None if ports.devices is None else await self._serve(self._devices(), ports.host, ports.devices)
        bench = ControlPort(self.controller, self.faults, self.clock, self.nudge)
        control = await self._serve(bench, ports.host, ports.control)
        rws = None if ports.rws is None else await self.rws.start(ports.host, *ports.rws)
        self._closing.push_async_callback(self.rws.close)
        if ports.egm is not None:
            await self.egm.start(*ports.egm)
            self._closing.push_async_callback(self.egm.close)
        profiler = None if ports.profiler is None else await self._start_profiler(ports.host, ports.profiler)
        sheet, further = cell_sheet(self.truth), (tuple(self.truth.further_cameras), tuple(self.truth.further_scanners))
        return Announcement(self.truth.seed, host, port, serial, devices, control, sheet, rws, profiler, *further)

    async def close(self) -> None:
        await self._closing.aclose()

    def flange_at(self, now_s: float) -> Array:
        """True flange pose (4, 4) at a time since the current move began."""
        start_T_base = self.controller.mounting.start_T_base(self.controller.external_axes)
        seen: Array = start_T_base @ self.controller.arm.true_base_T_flange(self.controller.robot_s(now_s))
        return seen

    def inject_fault(
        self, fault: str, *, strikes: int | None = None, only: Command | None = None, after_moves: int = 0
    ) -> None:
        """Switch a fault on, as `POST /faults/{name}` does."""
        self.faults.switch_on(fault, self.controller, self.clock(), strikes=strikes, only=only, after_moves=after_moves)
        self.nudge()

    def clear_faults(self, fault: str | None = None) -> None:
        self.faults.clear(self.controller, self.clock(), fault)
        self.nudge()

    def nudge(self) -> None:
        """Let the links react now to a change made from outside."""
        self._wires.nudge()
        self.rws.nudge()

    def _devices(self) -> object:
        from mock_robot.devices.http_devices import DeviceApp  # imports renderer and ray caster only when needed

        self.faults.table = {**self.faults.table, **DEVICE_FAULTS}
        return DeviceApp(self.truth, lambda: self.flange_at(self.clock()), self.faults)

    async def _start_profiler(self, host: str, port: int) -> str:
        from mock_robot.devices.profiler import MockProfiler  # imports the ray caster only when needed

        profiler = MockProfiler(self.truth, self.flange_at, self.clock)
        self._closing.push_async_callback(profiler.close)
        found, listening = await profiler.start(host, port)
        return f"profiles://{found}:{listening}"

    async def _serve(self, application: object, host: str, port: int) -> str:
        server = HttpServer(application)
        url = await server.start(host, port)
        self._closing.push_async_callback(server.close)
        return url
