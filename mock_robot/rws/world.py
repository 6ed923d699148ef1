"""State shared by both services: the cabinet behind the CB link, and what only RWS shows."""

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np

from calibration.transforms import Array, inverse, quaternion_from_rotation, transform
from mock_robot.cabinet.cabinet import Cabinet, LogEntry
from mock_robot.cabinet.panel import Mode
from mock_robot.faults.board import FaultBoard
from mock_robot.rapid.statements import HANDLED_ERROR
from mock_robot.rws.equipment import Equipment
from mock_robot.rws.exchange import Item
from mock_robot.rws.mastership import Mastership
from mock_robot.rws.memory import RwsMemory, RwsSignal

INFORMATION, WARNING, ERROR = 1, 2, 3
_TYPES: tuple[tuple[range, int], ...] = (
    (range(10000, 20000), INFORMATION),
    (range(HANDLED_ERROR, HANDLED_ERROR + 1), WARNING),
    (range(20000, 80000), ERROR),
    (range(80001, 80002), ERROR),
    (range(80002, 80003), WARNING),
    (range(80003, 80004), INFORMATION),
)
USER_EVENTS = range(80001, 80004)
"""Codes of ErrWrite: their texts have several lines, the first is the header."""
PAGE = 50


@dataclass(frozen=True)
class ControllerEventLog:
    """The event log of `GET /rw/elog/0`. `epoch` is the wall clock at zero of the cell's clock."""

    cabinet: Cabinet
    epoch: datetime

    def items(self, *, oldest_first: bool = False, version: int = 1) -> list[Item]:
        """One page of the entries, from the newest or from the oldest on."""
        log, newest = self.cabinet.log, self.cabinet.recorded
        numbered = [(newest - back, entry) for back, entry in enumerate(reversed(log))]
        page = (numbered[::-1] if oldest_first else numbered)[:PAGE]
        return [self._item(number, entry, version) for number, entry in page]

    def _item(self, number: int, entry: LogEntry, version: int) -> Item:
        at = self.epoch + timedelta(seconds=entry.at_s)
        lines = entry.text.split("\n") if entry.code in USER_EVENTS else []
        kind = next((kind for codes, kind in _TYPES if entry.code in codes), WARNING)
        values = {
            "msgtype": str(kind),
            "code": str(entry.code),
            **({"src-name": "MC0"} if version == 1 else {}),
            "tstamp": f"{at:%Y-%m-%d T %H:%M:%S}",
            "title": entry.text.split("\n")[0],
            "desc": entry.text.replace("\n", " "),
            "conseqs": "",
            "causes": "",
            "actions": "",
            "argc": str(len(lines)),
        }
        arguments = {"argv": [{"type": "STRING", "value": line} for line in lines]} if lines else {}
        return Item("elog-message-li", f"/rw/elog/0/{number}", {**values, **arguments})


MOTORS_ON_CODE, MOTORS_OFF_CODE, ESTOP_CODE, RELEASED_CODE = 10011, 10012, 10013, 10014
_SWITCHED = (MOTORS_ON_CODE, MOTORS_OFF_CODE, ESTOP_CODE, RELEASED_CODE)


@dataclass
class World:
    """State shown by the services. `programs` are called when RAPID starts."""

    cabinet: Cabinet
    faults: FaultBoard
    clock: Callable[[], float]
    memory: RwsMemory = field(default_factory=RwsMemory)
    mastership: Mastership = field(default_factory=Mastership)
    equipment: Equipment = field(default_factory=Equipment)
    tools: dict[str, Array] = field(default_factory=lambda: {"tool0": np.eye(4), "tGripper": _shift_z(150.0)})
    wobjs: dict[str, Array] = field(default_factory=lambda: {"wobj0": np.eye(4), "wobjTableN": _shift_z(100.0)})
    programs: list[Callable[[], None]] = field(default_factory=list)
    address: str = "127.0.0.1"
    backups: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.volumes = self.cabinet.disk
        self.elog = ControllerEventLog(self.cabinet, datetime.now(UTC) - timedelta(seconds=self.clock()))

    @property
    def tasks(self) -> dict[str, bool]:
        """The tasks, those of the program that runs among them, and whether each moves the arm."""
        return self.memory.tasks | {name: moves for name, (moves, _) in self.cabinet.program().items()}

    @property
    def modules(self) -> dict[str, dict[str, str]]:
        """Loaded modules by task, and the kind of each."""
        program = self.cabinet.program().items()
        return {
            task: self.memory.modules.get(task, {}) | dict(program).get(task, (False, {}))[1] for task in self.tasks
        }

    @property
    def signals(self) -> dict[str, RwsSignal]:
        """Signals by name, those of the program that runs in place of the cabinet's own."""
        own = {name: RwsSignal(*signal) for name, signal in self.cabinet.signals_now().items()}
        return self.memory.signals | own

    def signal(self, path: str) -> tuple[str, RwsSignal] | None:
        """Find `name`, or `network/device/name`; a signal without a device is found at any."""
        place, _, name = path.strip("/").rpartition("/")
        signal = self.signals.get(name)
        return None if signal is None or (place and signal.place not in ("", place)) else (name, signal)

    def take_configuration(self) -> None:
        """Restart with what was loaded: tasks and signals of the configuration are there from now on."""
        tasks = self.equipment.configuration.get("SYS", {}).get("CAB_TASKS", {})
        for name, task in tasks.items():
            self.memory.tasks[name] = "MotionTask" in task.attributes
            self.memory.modules.setdefault(name, {})
        for name, signal in self.equipment.configuration.get("EIO", {}).get("EIO_SIGNAL", {}).items():
            self.memory.signals.setdefault(name, RwsSignal(signal.attributes.get("SignalType", "DO"), "", False))

    def remove_robot_program(self) -> None:
        """Leave a controller as it is delivered: without the robot program's task and signals."""
        self.memory.tasks = {"T_ROB1": True}
        self.memory.modules = {"T_ROB1": {"BASE": "SysMod", "user": "SysMod"}}
        self.memory.signals = {n: s for n, s in self.memory.signals.items() if not n.startswith("cell_")}

    @property
    def mode(self) -> Mode:
        return self.cabinet.panel.mode

    @property
    def selection(self) -> tuple[str, str]:
        """Tool and work object selected at the pendant now, the default of requests that name none."""
        return ("tGripper", "wobjTableN") if self.faults.is_on("rws-other-tool") else ("tool0", "wobj0")

    @property
    def controller_state(self) -> str:
        """Controller state by its RWS name. After an emergency stop the motors must be switched on."""
        panel = self.cabinet.panel
        if panel.emergency_stop:
            return "emergencystop"
        if panel.motors_on:
            return "motoron"
        last = next((entry.code for entry in reversed(self.cabinet.log) if entry.code in _SWITCHED), MOTORS_OFF_CODE)
        return "emergencystopreset" if last == RELEASED_CODE else "motoroff"

    @property
    def execution_state(self) -> str:
        """Whether RAPID is running, by its RWS name."""
        return "running" if self.cabinet.panel.program_running else "stopped"

    @property
    def joints_deg(self) -> Array:
        """Axes (6,) now."""
        degrees: Array = np.degrees(self.cabinet.arm.joints_at(self.robot_s))[:6]
        return degrees

    @property
    def configuration(self) -> tuple[int, int, int, int]:
        """cf1, cf4, cf6, cfx."""
        cf1, cf4, cf6, cfx = self.cabinet.arm.arm.configuration(self.cabinet.arm.joints_at(self.robot_s))
        return cf1, cf4, cf6, cfx

    def pose(self, tool: str, wobj: str, coordinate: str) -> tuple[Array, Array]:
        """Position (3,) mm and quaternion (4,) wxyz of a tool. KeyError: unknown tool, work object or coordinates."""
        base_T_tool = self.cabinet.arm.reported_base_T_flange(self.robot_s) @ self.tools[tool]
        world_T_tool = self.cabinet.world_T_base @ base_T_tool
        pose = {
            "base": base_T_tool,
            "world": world_T_tool,
            "word": world_T_tool,  # spelled so in ABB's documents and clients
            "wobj": world_T_tool if wobj == "wobj0" else inverse(self.wobjs[wobj]) @ world_T_tool,
            "tool": np.eye(4),
        }[coordinate.lower()]
        return pose[:3, 3], quaternion_from_rotation(pose[:3, :3])

    @property
    def robot_s(self) -> float:
        """The arm's time now."""
        return self.cabinet.robot_s(self.clock())


def _shift_z(z_mm: float) -> Array:
    return transform(np.eye(3), [0.0, 0.0, z_mm])
