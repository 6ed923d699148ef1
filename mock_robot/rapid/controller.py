"""A cabinet that runs the RAPID of deploy/rapid: tasks, their services, configuration and switches."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

from mock_robot.cabinet.cabinet import TITLES, Cabinet
from mock_robot.cabinet.panel import Panel
from mock_robot.errors import MockError
from mock_robot.faults.tables import FAULTS
from mock_robot.rapid.configuration import (
    FACTORY_TASK,
    Fragments,
    TaskPlan,
    egm_devices,
    serial_ports,
    signals,
    task_plans,
)
from mock_robot.rapid.devices import FrameFaultBoard, SerialLine
from mock_robot.rapid.errors import ProgramStopped
from mock_robot.rapid.home import HomeFragments
from mock_robot.rapid.interrupts import Interrupts
from mock_robot.rapid.program import PersistentMemory, Program
from mock_robot.rapid.scope import ErrorNumbers
from mock_robot.rapid.signals import DIGITAL, Signal
from mock_robot.rapid.symbols import LiveSymbol
from mock_robot.rapid.tasks import ERROR, ErrorEvent, ProgramTask
from mock_robot.rapid.unit import MotionUnit
from protocols.cb import messages as cb
from protocols.cb.codes import Status


@dataclass
class OpenDevices:
    """Open devices, the controller's addresses, and whether clients can connect.

    `virtual`: RobotStudio's controller, which has no address of its own. Without `network`, nothing can be bound, and
    a listening socket is closed. `address`: of a bound socket; input of a serial line from before it is `reachable`
    may be discarded.
    """

    host: str = "127.0.0.1"
    virtual: bool = False
    network: bool = True
    lines: dict[str, SerialLine] = field(default_factory=dict)
    address: tuple[str, int] | None = None
    reachable: threading.Event = field(default_factory=threading.Event)
    _open: dict[int, Any] = field(default_factory=dict)

    def add(self, device: Any) -> None:
        self._open[id(device)] = device

    def drop(self, device: Any) -> None:
        self._open.pop(id(device), None)

    def close(self) -> None:
        for device in list(self._open.values()):
            device.close()
        self._open.clear()
        self.reachable.clear()


MAX_CLOCK_S = 4_294_967.0
"""After 49 days and 17 hours a controller's clock overflows."""


@dataclass(frozen=True)
class Services:
    """Services of one task. `max_clock_s`: the age at which its clocks overflow.

    `egm_devices`: by name the port they send to, None where the mock's own sender does.
    """

    unit: MotionUnit
    panel: Panel
    devices: OpenDevices
    wire: FrameFaultBoard
    interrupts: Interrupts
    errors: ErrorNumbers
    note: Callable[[int, str], None]
    max_clock_s: float = MAX_CLOCK_S
    signals: Mapping[str, Signal] = field(default_factory=dict)
    egm_devices: Mapping[str, int | None] = field(default_factory=dict)


_PLACES = (Path(__file__).parent / "modules", Path(__file__).parents[2] / "deploy" / "rapid")
DEPLOYED = next((place for place in _PLACES if place.is_dir()), _PLACES[-1])
"""Folder of the shipped modules: beside this file when installed, deploy/rapid in the repository."""
READY_LIMIT_S = 20.0
SYSTEM_STOP = 10014


@dataclass
class Loaded:
    """A loaded task and what belongs to it."""

    plan: TaskPlan
    task: ProgramTask
    interrupts: Interrupts


@dataclass
class RapidController(Cabinet):
    """Tasks in threads, from `begin` to `end`. `settings`: PERS values an integrator sets before loading.

    `home`: the folder is a controller's HOME or backup, read by `HomeFragments`. `robotware`: 6 or 7, whose
    configuration fragments are loaded. `max_clock_s`: the age at which clocks overflow.
    """

    clock: Callable[[], float] = monotonic
    folder: Path = DEPLOYED
    robotware: int = 6
    home: bool = False
    max_clock_s: float = MAX_CLOCK_S
    settings: dict[str, Any] = field(default_factory=dict)
    board: FrameFaultBoard = field(default_factory=lambda: FrameFaultBoard(FAULTS))
    devices: OpenDevices = field(default_factory=OpenDevices)
    memory: PersistentMemory = field(default_factory=PersistentMemory, init=False)
    unit: MotionUnit = field(init=False)
    signals: dict[str, Signal] = field(default_factory=dict, init=False)
    _loaded: list[Loaded] = field(default_factory=list, init=False)
    _error: set[str] = field(default_factory=set, init=False)
    _turn: Any = field(default_factory=threading.RLock, init=False)
    _switching: Any = field(default_factory=threading.RLock, init=False)

    def __post_init__(self) -> None:
        if not self.folder.is_dir():
            raise MockError(
                f"{self.folder} is not there: name the folder of the RAPID modules, or use the Python program"
            )
        if self.home:
            foreign = HomeFragments(self.folder, self.robotware)
            self._fragments: Fragments = foreign
            self._plans = foreign.task_plans()
        else:
            self._fragments = Fragments(self.folder, self.robotware)
            self._plans = task_plans(self._fragments)
        motion = next((plan.name for plan in self._plans if plan.motion), FACTORY_TASK)
        self.unit = MotionUnit(self, self.clock, motion, lambda: self.board.wake(self, self.clock()))

    def stand_axes(self, external_axes: tuple[float, ...]) -> None:
        super().stand_axes(external_axes)
        self.unit.external = list(external_axes)

    # --- lifecycle ---

    def begin(self, serial_fileno: int | None = None) -> None:
        """Load the program, apply the integrator's settings, start every task."""
        if serial_fileno is not None:
            self.devices.lines = {name: SerialLine(serial_fileno) for name in serial_ports(self._fragments)}
        self._load()
        for name, value in self.settings.items():
            self.memory.preset(name, value)
        self._run()

    def await_link(self) -> None:
        """Wait until a client can connect. Raises MockError on timeout."""
        if not self.devices.reachable.wait(READY_LIMIT_S):
            raise MockError(f"the RAPID program does not answer: {self.log[-1].text if self.log else 'no event'}")
        if self.devices.address is not None:
            self.memory.preset("cell_port", float(self.devices.address[1]))

    def end(self) -> None:
        with self._turn:
            for loaded in self._loaded:
                loaded.interrupts.end()
            for loaded in self._loaded:
                loaded.task.end()
            self._loaded.clear()
            self.devices.close()
            self.unit.end_egm()

    def whereabouts(self) -> dict[str, list[str]]:
        """Statements each task is at, innermost first, for debugging."""
        return {loaded.task.name: loaded.task.whereabouts() for loaded in self._loaded}

    def restart(self, now_s: float) -> None:
        """Warm start: PERS keep their values, everything else is reset, the program starts from main."""
        if any(loaded.task.is_current for loaded in self._loaded):
            threading.Thread(target=self._restart, name="rapid restart", daemon=True).start()
        else:
            self._restart()

    def _restart(self) -> None:
        with self._turn:
            had_link = self.devices.reachable.is_set()
            self.end()
            self.unit.reset()
            self._error.clear()
            self.record(self.clock(), 10002, "controller restarted")
            self._load()
            self._run()
        if had_link:
            self.await_link()

    def fail_power(self, now_s: float) -> None:
        """A power failure and the start after it: the arm stops where it is, with its path and program pointer.

        Tasks other than NORMAL begin anew, without the StopMove they had. Motors and program are started by hand.
        """
        self.switch_motors(False, now_s)
        self.run_program(False, now_s)
        with self._turn:
            background = [loaded for loaded in self._loaded if loaded.plan.kind != "NORMAL"]
            for loaded in background:
                loaded.interrupts.end()
                loaded.task.end()
                self._loaded.remove(loaded)
            self.devices.close()
            self.unit.stopped_by.difference_update(loaded.task.name for loaded in background)
            begun = [self._load_task(loaded.plan) for loaded in background]
            self._loaded += begun
            self._watch()
            for loaded in begun:
                loaded.task.begin(running=True)

    def _load(self) -> None:
        outputs: dict[str, Callable[[str], bool]] = {
            "MotOnState": lambda _: self.panel.motors_on,
            "EmStop": lambda _: self.panel.emergency_stop,
            "TaskExecuting": lambda name: any(one.task.running for one in self._loaded if one.task.name == name),
            "Error": lambda name: name in self._error,
        }
        fragments = self._fragments
        self.signals = fragments.signals() if isinstance(fragments, HomeFragments) else signals(fragments, outputs)
        self._loaded += [self._load_task(plan) for plan in self._plans]
        self._watch()

    def _load_task(self, plan: TaskPlan) -> Loaded:
        task = ProgramTask(plan.name, self.stop_failed_program, plan.motion, now_s=self.clock)
        program = Program(task, self.memory, self.signals)
        program.load(plan.sources)
        interrupts = Interrupts(task)
        task.services = Services(
            self.unit,
            self.panel,
            self.devices,
            self.board,
            interrupts,
            program.errors,
            self._note,
            self.max_clock_s,
            self.signals,
            egm_devices(self._fragments),
        )
        main = program.main()

        def cycle() -> None:
            main()
            over = not plan.motion
            while not over:  # a pendant that switches between the last instruction and here is heeded first
                task.attend()
                with self._switching:
                    over = not task.attention
                    if over and self.panel.cycle == "once":
                        self.run_program(False, self.clock())

        task.main = cycle
        return Loaded(plan, task, interrupts)

    def _watch(self) -> None:
        """Mirror the program's own state for tests."""
        session, armed = self.memory.find("cell_session"), self.memory.find("cell_armed")
        if session is None or armed is None:
            return  # a program other than the shipped one

        def notice() -> None:
            self.session, self.armed = int(session.value), bool(armed.value)

        session.watchers = armed.watchers = (notice,)

    def _run(self) -> None:
        with self._switching:  # ordered against a switch turned meanwhile
            allowed = self.panel.forbids_motion() is None
            self.unit.held = not allowed
            for loaded in self._loaded:
                loaded.task.begin(running=allowed or loaded.plan.kind != "NORMAL")

    # --- switches ---

    def tick(self, now_s: float) -> list[cb.Success]:
        """Nothing to do: the tasks run in threads."""
        return []

    def halt(self, now_s: float, result: Status) -> None:
        """Stop every normal task and the arm, as a controller does when its program stops."""
        with self._switching:
            self.panel.program_running = False
            for loaded in self._loaded:
                if loaded.plan.kind == "NORMAL":
                    loaded.task.stop()
            self.unit.hold()

    def run_program(self, running: bool, now_s: float) -> None:
        """Start or stop the program as the pendant does; ordered against a program that stops by itself."""
        with self._switching:
            super().run_program(running, now_s)

    def move_pointer_to_main(self, now_s: float) -> None:
        """PP to main at the pendant: every normal task begins at main, without its path, interrupts and EGM."""
        with self._switching:
            super().move_pointer_to_main(now_s)
            self.unit.clear()
            self.unit.end_egm()
            for loaded in self._loaded:
                if loaded.plan.kind == "NORMAL":
                    loaded.interrupts.end()
                    loaded.task.move_pointer_to_main()

    def apply_panel(self, now_s: float) -> None:
        """Stop what the panel forbids; resume stopped tasks when the program is started."""
        with self._switching:
            super().apply_panel(now_s)
            if self.panel.forbids_motion() is None:
                self._error.clear()
                self.unit.held = False  # an interrupted move continues when its task does
                for loaded in self._loaded:
                    loaded.task.start()

    def stop_failed_program(self, task: ProgramTask, stopped: ProgramStopped) -> None:
        """Log a program that stopped by itself, and stop all tasks when the task is trusted."""
        with self._switching:
            task.stop()
            self._error.add(task.name)
            now_s = self.clock()
            self.record(now_s, stopped.code, f"{task.name} stopped at {stopped.where}: {stopped.text}")
            event = ErrorEvent(*divmod(stopped.code, 10_000), ERROR, TITLES.get(stopped.code, ""), stopped.text)
            for loaded in self._loaded:
                loaded.interrupts.note_event(event)
            plan = next((loaded.plan for loaded in self._loaded if loaded.task is task), None)
            if plan is None:
                return
            if plan.motion:
                self.unit.clear()
            if plan.stops_all:
                self.record(now_s, SYSTEM_STOP, f"{task.name} is a trusted task: all tasks are stopped")
            if plan.stops_all or plan.kind == "NORMAL":
                self.halt(now_s, Status.MOTION_ERROR)

    def symbol(self, task: str, module: str, name: str) -> LiveSymbol | None:
        """A PERS of a loaded module, by names in lower case; `module` may be empty."""
        for loaded in self._loaded:
            if loaded.plan.name.casefold() != task:
                continue
            files = {source.name.rpartition(".")[0].casefold(): source.name for source in loaded.plan.sources}
            if module and module not in files:
                return None
            own = f"{loaded.plan.name}/"
            places = (*((f"{own}{files[module]}/{name}",) if module else ()), own + name, name)
            return next((found for place in places if (found := self.memory.symbol(place)) is not None), None)
        return None

    def program(self) -> dict[str, tuple[bool, dict[str, str]]]:
        kinds = {".sys": "SysMod", ".SYS": "SysMod"}
        named = {each.plan: [source.name for source in each.plan.sources] for each in self._loaded}
        return {
            plan.name: (plan.motion, {name[:-4]: kinds.get(name[-4:], "ProgMod") for name in names})
            for plan, names in named.items()
        }

    def signals_now(self) -> dict[str, tuple[str, str, bool, float]]:
        return {each.name: (each.kind, each.place, each.written, float(each.read())) for each in self.signals.values()}

    def set_signal(self, name: str, value: float) -> bool:
        signal = self.signals.get(name)
        if signal is not None:
            signal.value = bool(value) if signal.kind in DIGITAL else value
        return signal is not None

    def _note(self, code: int, text: str) -> None:
        self.record(self.clock(), code, text)
