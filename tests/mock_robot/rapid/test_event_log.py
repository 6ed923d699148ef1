"""What the link task leaves in the controller's event log, by hours of simulated time; and its clocks' overflow."""

import select
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.configuration import Fragments, task_plans
from mock_robot.rapid.controller import DEPLOYED, MAX_CLOCK_S, OpenDevices
from mock_robot.rapid.devices import FrameFaultBoard
from mock_robot.rapid.errors import CycleLeft
from mock_robot.rapid.interrupts import Interrupts
from mock_robot.rapid.program import PersistentMemory, Program
from mock_robot.rapid.signals import Signal
from mock_robot.rapid.statements import HANDLED_ERROR
from mock_robot.rapid.tasks import ProgramTask
from protocols.cb import messages as cb
from protocols.cb.client import ClientSession
from tests.mock_robot.rapid.snippets import raise_failure, ran

pytestmark = pytest.mark.slow
SIGNALS = ("cell_do_motors", "cell_do_estop", "cell_do_running", "cell_do_error")
JOINTS = [[0.0] * 6, [9e9] * 6]


class SimulatedTask(ProgramTask):
    """A task in this thread: a wait moves its clock on instead of taking time."""

    def __init__(self, until_s: float, meanwhile: Callable[[float], None]) -> None:
        self.time_s, self.until_s, self.meanwhile = 0.0, until_s, meanwhile
        super().__init__("T_HANDEYED", raise_failure, motion=False, now_s=lambda: self.time_s)

    def wait(self, seconds: float | None, fileno: int | None = None, until: Any = None) -> bool:
        assert seconds is not None
        self.meanwhile(self.time_s)
        if fileno is not None and select.select([fileno], [], [], 0.0)[0]:
            return True
        self.time_s += max(seconds, 1e-4)
        if self.time_s >= self.until_s:
            raise CycleLeft
        return False


@dataclass
class Controller:
    """The link task alone, beside a motion task that shows life and answers aborts at once."""

    until_s: float
    max_clock_s: float = MAX_CLOCK_S
    client: Callable[["Controller", float], None] = lambda controller, now_s: None
    entries: list[tuple[float, int, str]] = field(default_factory=list)
    devices: OpenDevices = field(default_factory=OpenDevices)
    memory: PersistentMemory = field(default_factory=PersistentMemory)

    def __post_init__(self) -> None:
        self.task = SimulatedTask(self.until_s, self._meanwhile)
        on, off = Signal("on", "DO", lambda: True), Signal("off", "DO")
        program = Program(self.task, self.memory, dict(zip(SIGNALS, (on, off, on, off), strict=True)))
        plan = next(plan for plan in task_plans(Fragments(DEPLOYED, 6)) if plan.name == "T_HANDEYED")
        program.load(plan.sources)
        unit = SimpleNamespace(
            stopped_by=set(), task_name="T_ROB1", is_moving=lambda: False, joints_now=lambda: [0.0] * 6, time_scale=1.0
        )
        self.task.services = SimpleNamespace(
            unit=unit,
            panel=SimpleNamespace(mode=Mode.AUTO, speed_override=1.0),
            devices=self.devices,
            wire=FrameFaultBoard({}),
            interrupts=Interrupts(self.task),
            errors=program.errors,
            note=lambda code, text: self.entries.append((self.task.time_s, code, text)),
            max_clock_s=self.max_clock_s,
        )
        self.task.running = True
        self.main = program.main()
        self.memory.preset("cell_address", "127.0.0.1")
        self.memory.preset("cell_port", 0.0)
        self.memory.preset("cell_serves", True)

    def runs(self) -> "Controller":
        try:
            with pytest.raises(CycleLeft):
                self.main()
        finally:
            self.devices.close()
        return self

    def entries_a_minute(self) -> int:
        """The most entries within any minute of the clock."""
        minutes = [int(at_s // 60) for at_s, _, _ in self.entries]
        return max((minutes.count(minute) for minute in minutes), default=0)

    def _meanwhile(self, now_s: float) -> None:
        self.memory["cell_beat"].value = float(int(now_s * 4) % 1000)
        self.memory["cell_abort"].value = False
        self.client(self, now_s)


class Pc:
    """A client on simulated time: connects at 1 s, says HELLO, and then asks every `every_s` until `until_s`."""

    def __init__(self, every_s: float, until_s: float = 1e9) -> None:
        self.every_s, self.until_s, self.next_s, self.answers = every_s, until_s, 1.0, 0
        self.session = ClientSession(resynchronise=False)
        self.socket: socket.socket | None = None

    def __call__(self, controller: Controller, now_s: float) -> None:
        if self.socket is not None and (received := self._received()):
            self.answers += len(self.session.receive_data(received))
        if not self.next_s <= now_s < self.until_s or controller.devices.address is None:
            return
        self.next_s = now_s + self.every_s
        request: cb.Request = cb.GetStatus()
        if self.socket is None:
            self.socket = socket.create_connection(controller.devices.address)
            self.socket.setblocking(False)
            request = cb.Hello(1, 1, 9)
        self.socket.send(self.session.request(request))

    def _received(self) -> bytes:
        assert self.socket is not None
        try:
            return self.socket.recv(4096)
        except BlockingIOError:
            return b""


@contextmanager
def pc(every_s: float, until_s: float = 1e9) -> Iterator[Pc]:
    client = Pc(every_s, until_s)
    try:
        yield client
    finally:
        if client.socket is not None:
            client.socket.close()


def test_an_idle_hour_leaves_the_log_empty() -> None:
    assert Controller(3600.0).runs().entries == []


@pytest.mark.parametrize(("every_s", "until_s"), [(1.9, 300.0), (0.1, 100.0)], ids=["quiet", "busy"])
def test_minutes_with_a_client_leave_the_log_empty(every_s: float, until_s: float) -> None:
    with pc(every_s) as client:
        controller = Controller(until_s, client=client).runs()
        assert controller.entries == []
        assert client.answers > 0.5 * until_s / every_s


def test_an_hour_with_the_plug_pulled_leaves_at_most_one_entry_a_minute() -> None:
    def plug(controller: Controller, now_s: float) -> None:
        client(controller, now_s)
        controller.devices.network = not 30.0 < now_s < 3000.0

    with pc(0.5, until_s=30.0) as client:
        controller = Controller(3600.0, client=plug).runs()
    assert controller.entries_a_minute() == 1
    assert {code for _, code, _ in controller.entries} == {80003}
    assert controller.devices.address is not None


def test_a_virtual_controller_is_bound_to_the_loopback_address() -> None:
    controller = Controller(5.0)
    controller.memory.preset("cell_address", "")
    controller.devices.virtual = True
    controller.runs()
    assert controller.entries == []
    assert controller.devices.address is not None


@pytest.mark.parametrize("serving", [False, True])
def test_a_clock_that_overflows_ends_nothing(serving: bool) -> None:
    with pc(1.0 if serving else 1e9) as client:
        controller = Controller(60.0, max_clock_s=3.0, client=client).runs()
        assert controller.entries == []
        assert client.answers >= (50 if serving else 0)


def test_a_handled_error_is_logged_unless_its_handler_skips_the_warning() -> None:
    loud = ran("n := 1 / n;", "VAR num n;", "TRYNEXT;")
    assert ["ERR_DIVZERO" in text for text in loud.noted] == [True]
    assert ran("n := 1 / n;", "VAR num n;", "SkipWarn;\nTRYNEXT;").noted == []
    assert HANDLED_ERROR not in (10020, 80003)
