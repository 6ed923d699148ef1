"""The shipped RAPID beside a customer's program, and what it does besides poses: axes, outputs, interlocks, errors."""

import asyncio
import shutil
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.links.wires import CAMERA_LOAD
from mock_robot.rapid.controller import DEPLOYED, RapidController
from protocols.cb import messages as cb
from protocols.cb.codes import Output, Status
from tests.mock_robot.cb_client import CbClient, over_tcp
from tests.mock_robot.controller_client import ARM, AWAY, HOME, UNUSED, move_to
from tests.support.waiting import eventually

SETTINGS = {"cell_address": "127.0.0.1", "cell_port": 0.0, "cell_flange": CAMERA_LOAD}
PRODUCTION = """MODULE production
  PERS tooldata gripper := [TRUE, [[0, 0, 200], [1, 0, 0, 0]], [8, [0, 0, 90], [1, 0, 0, 0], 0, 0, 0]];
  PERS wobjdata table := [FALSE, TRUE, "", [[800, 0, 0], [1, 0, 0, 0]], [[0, 0, 0], [1, 0, 0, 0]]];
  PERS loaddata part := [3, [0, 0, 50], [1, 0, 0, 0], 0, 0, 0];
  PERS num turns := 0;
  PERS num visits := 0;
  PERS bool called := FALSE;
  PERS bool busy := FALSE;
  PERS bool works := FALSE;
  PERS string found_tool := "";
  PERS string found_wobj := "";
  PERS string found_load := "";
  PERS motsetdata before := [[0, 0], [0, 0, 0], [FALSE, FALSE, FALSE], [FALSE, FALSE, 0, 0, 0]];
  PERS motsetdata after := [[0, 0], [0, 0, 0], [FALSE, FALSE, FALSE], [FALSE, FALSE, 0, 0, 0]];
  PROC main()
    ConfJ \\Off;
    ConfL \\Off;
    SingArea \\Wrist;
    VelSet 50, 800;
    GripLoad part;
    SetSysData gripper;
    SetSysData table;
    before := C_MOTSET;
    WHILE TRUE DO
      turns := turns + 1;
      IF works busy := TRUE;
      WaitUntil NOT (busy AND works) \\PollRate:=0.04;
      called := cell_wanted;
      cell_motion;
      IF called visits := visits + 1;
      after := C_MOTSET;
      GetSysData gripper \\ObjectName:=found_tool;
      GetSysData table \\ObjectName:=found_wobj;
      GetSysData part \\ObjectName:=found_load;
      WaitTime 0.02;
    ENDWHILE
  ENDPROC
ENDMODULE
"""


@asynccontextmanager
async def running(
    tmp_path: Path,
    *,
    production: str = "",
    settings: Mapping[str, Any] | None = None,
    time_scale: float = 20.0,
    clock: Callable[[], float] = monotonic,
    egm: bool = False,
) -> AsyncIterator[RapidController]:
    """A controller with the shipped modules; with `production`, a module, their motion part is called by its main."""
    folder = Path(shutil.copytree(DEPLOYED, tmp_path / "rapid"))
    if production:
        names = ["production", *(["CELL_egm"] if egm else [])]
        modules = "".join(f'      -File "HOME:/{name}.mod" -ModName "{name}" -Task "T_ROB1"\n\n' for name in names)
        called = (folder / "rw6" / "called" / "SYS.cfg").read_text("ascii")
        (folder / "rw6" / "SYS.cfg").write_text(called.replace("#\nCAB_TASKS:", f"{modules}#\nCAB_TASKS:"))
        (folder / "production.mod").write_text(production)
    eio = folder / "rw6" / "EIO.cfg"
    signals = '\n\n      -Name "do_light" -SignalType "DO"\n\n      -Name "di_gate" -SignalType "DI"\n'
    eio.write_text(eio.read_text("ascii").rstrip() + signals)
    arm = SimulatedArm(ARM, HOME, ArmNoise())
    given = {**SETTINGS, **(settings or {})}
    controller = RapidController(arm, 5, time_scale, settings=given, folder=folder, clock=clock)
    try:
        await asyncio.to_thread(controller.begin)
        await asyncio.to_thread(controller.await_link)
        yield controller
    finally:
        await asyncio.to_thread(controller.end)


@asynccontextmanager
async def client_of(controller: RapidController) -> AsyncIterator[CbClient]:
    assert controller.devices.address is not None
    async with over_tcp(controller.devices.address[1]) as client:
        yield client


def value(controller: RapidController, name: str) -> Any:
    return controller.memory[name].value


@pytest.mark.slow
async def test_a_customers_main_finds_everything_as_it_was_before(tmp_path: Path) -> None:
    async with running(tmp_path, production=PRODUCTION) as controller:
        await eventually(lambda: value(controller, "turns") > 2 and not value(controller, "cell_abort"))
        beats, turns = value(controller, "cell_beat"), value(controller, "turns")
        await eventually(lambda: value(controller, "turns") > turns + 20)
        assert value(controller, "cell_beat") == beats, "nothing of ours runs without a client"
        async with client_of(controller) as client:
            await client.is_armed()
            turns = value(controller, "turns")
            assert await client.moves(move_to(AWAY, 1000.0)) is Status.OK
            assert controller.unit.active["tooldata"][0] == "cell_flange"
            assert controller.unit.active["loaddata"][0] == "load0"
            assert await client.asks(move_to(HOME, 50.0)) == cb.MoveAccepted()
            await eventually(controller.unit.is_moving)
            assert await client.asks(cb.Stop()) == cb.Stopped()
            await eventually(lambda: not value(controller, "cell_abort"))
            assert value(controller, "turns") == turns, "production waits"
            assert await client.asks(cb.Bye()) == cb.Farewell()
        await eventually(lambda: value(controller, "visits") == 1 and value(controller, "turns") > turns + 2)
        assert value(controller, "after") == value(controller, "before")
        assert value(controller, "before") != [[100, 5000], [100, 100, 100], [False] * 3, [True, True, 30, 30, 30]]
        assert [value(controller, f"found_{what}") for what in ("tool", "wobj", "load")] == ["gripper", "table", "part"]
        motion = next(loaded for loaded in controller._loaded if loaded.task.name == "T_ROB1")
        assert not motion.interrupts._orders, "no trap of ours is connected"
        assert not controller.unit.stopped_by
        assert error_codes(controller) == []


async def test_a_busy_customer_is_not_interrupted_and_arming_waits_for_it(tmp_path: Path) -> None:
    async with running(tmp_path, production=PRODUCTION) as controller:
        await eventually(lambda: value(controller, "turns") > 1)
        controller.memory["works"].value = True
        await eventually(lambda: bool(value(controller, "busy")))  # by the customer's program, which waits from here on
        async with client_of(controller) as client:
            welcome = await client.asks(cb.Hello(1, 1, 9))
            assert isinstance(welcome, cb.Welcome)
            beats = value(controller, "cell_beat")
            assert await client.asks(cb.SetArmed(welcome.session, True)) == cb.Refused(Status.WRONG_MODE)
            assert value(controller, "cell_beat") == beats
            controller.memory["works"].value = False
            await eventually(lambda: value(controller, "cell_beat") > beats)
            await client.is_armed()
            controller.memory["busy"].value = False
            controller.memory["works"].value = True
            assert await client.asks(cb.Bye()) == cb.Farewell()
        await eventually(lambda: bool(value(controller, "busy")))
        async with client_of(controller) as client:
            welcome = await client.asks(cb.Hello(1, 1, 9))
            assert isinstance(welcome, cb.Welcome)
            # The signs of life of the call before are young, but they are none of this one.
            assert await client.asks(cb.SetArmed(welcome.session, True)) == cb.Refused(Status.WRONG_MODE)


LEAVES = """
  TRAP customers_trap
    ExitCycle;
  ENDTRAP
ENDMODULE
"""


@pytest.mark.slow
async def test_a_customer_who_leaves_the_motion_part_by_exitcycle_finds_nothing_of_ours_behind(tmp_path: Path) -> None:
    program = PRODUCTION.removesuffix("ENDMODULE\n") + LEAVES
    program = program.replace("PROC main()\n", "VAR intnum customers;\n  PERS bool leave := FALSE;\n  PROC main()\n")
    connects = "CONNECT customers WITH customers_trap;\n    IPers leave, customers;\n    WHILE TRUE DO\n"
    program = program.replace("WHILE TRUE DO\n", f"IDelete customers;\n    {connects}")
    async with running(tmp_path, production=program) as controller:
        await eventually(lambda: value(controller, "turns") > 2 and not value(controller, "cell_abort"))
        async with client_of(controller) as client:
            await client.is_armed()
            turns = value(controller, "turns")
            controller.memory["works"].value = True
            controller.memory["leave"].value = True
            await eventually(lambda: value(controller, "turns") > turns and bool(value(controller, "busy")))
            controller.memory["cell_abort"].value = True
            controller.memory["cell_bell"].value = 5.0
            motion = next(loaded for loaded in controller._loaded if loaded.task.name == "T_ROB1")
            assert len(motion.interrupts._orders) == 1, "the customer's own"
            controller.memory["works"].value = False
            await eventually(lambda: value(controller, "cell_serves"))
        assert error_codes(controller) == []


BORDER = np.radians([0.2, 15.0, 0.0, -0.2, 65.0, 0.2])
"""Beside quadrant borders of axes 1, 4 and 6: a goal that crosses them has another confdata than the arm has here."""


def read_a_tenth() -> float:
    """A clock that goes so slowly that a busy machine is quick enough for the limits of time in the program."""
    return monotonic() / 10


async def test_a_goal_beyond_a_border_of_confdata_is_reached_in_the_nearest_posture(tmp_path: Path) -> None:
    """Without a known arm each goal carries the confdata that the arm has now; T_ROB1 finds a posture in 1 s."""
    beyond = np.radians([-2.0, 15.0, 0.0, 3.0, 65.0, -2.0])
    request = cb.Move(*_pose(beyond), ARM.configuration(BORDER), UNUSED, 500.0, cb.MoveKind.JOINT)
    assert ARM.configuration(BORDER) != ARM.configuration(beyond)
    async with running(tmp_path, time_scale=200.0, clock=read_a_tenth) as controller, client_of(controller) as client:
        await client.is_armed()
        assert await client.moves(move_to(BORDER, 500.0)) is Status.OK
        assert await client.moves(request) is Status.OK
        np.testing.assert_allclose(controller.unit.joints_now(), beyond, atol=1e-4)
        controller.memory["cell_travel_max"].value = 1.0
        assert await client.moves(move_to(BORDER, 500.0)) is Status.UNREACHABLE
        assert controller.moves_accepted == 2


def _pose(joints: np.ndarray) -> tuple[cb.Three, cb.Four]:
    request = move_to(joints)
    return request.position_mm, request.quaternion_wxyz


async def test_axes_are_moved_to_their_angles_at_a_border_and_a_singularity(tmp_path: Path) -> None:
    straight = np.radians([0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    async with running(tmp_path) as controller, client_of(controller) as client:
        await client.is_armed()
        for joints in (straight, AWAY):
            request = cb.MoveJoints(tuple(np.degrees(joints)), UNUSED, 1000.0)
            assert await client.asks(request) == cb.JointMoveAccepted()
            await eventually(lambda: not controller.unit.is_moving() and value(controller, "cell_done"))
            np.testing.assert_allclose(controller.unit.joints_now(), joints, atol=1e-5)
        controller.memory["cell_box_high"].value = [10.0, 10.0, 10.0]
        request = cb.MoveJoints(tuple(np.degrees(HOME)), UNUSED, 1000.0)
        assert await client.asks(request) == cb.Refused(Status.OUTSIDE_BOX)
        assert controller.moves_accepted == 2


async def test_the_one_gram_of_tool0_is_refused_when_arming_and_when_moving(tmp_path: Path) -> None:
    async with running(tmp_path) as controller, client_of(controller) as client:
        await client.is_armed()
        setup = await client.asks(cb.GetSetup())
        assert isinstance(setup, cb.Setup)
        assert (setup.load_kg, setup.load_centre_mm, setup.reach_mm) == (1.5, (0.0, 0.0, 60.0), 400.0)
        tool0 = [True, CAMERA_LOAD[1], [0.001, [0.0, 0.0, 0.001], [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0]]
        controller.memory["cell_flange"].value = tool0
        assert await client.moves(move_to(AWAY)) is Status.NO_LOAD
        assert await client.asks(cb.SetArmed(controller.session, True)) == cb.Refused(Status.NO_LOAD)
        assert controller.moves_accepted == 0


async def test_an_interlock_that_opens_stops_the_arm_and_an_output_follows_its_name(tmp_path: Path) -> None:
    named = {"cell_light": "do_light", "cell_interlock": ["di_gate", "", "", ""]}
    async with running(tmp_path, settings=named, time_scale=1.0) as controller, client_of(controller) as client:
        welcome = await client.asks(cb.Hello(1, 1, 9))
        assert isinstance(welcome, cb.Welcome)
        assert await client.asks(cb.SetArmed(welcome.session, True)) == cb.Refused(Status.INTERLOCK)
        controller.signals["di_gate"].value = True
        await client.is_armed()
        for on in (True, False):
            assert await client.asks(cb.SetOutput(Output.LIGHT, on)) == cb.OutputDone()
            assert controller.signals["do_light"].value is on
        assert await client.asks(cb.SetOutput(Output.TRIGGER, True)) == cb.Refused(Status.BAD_FIELD)
        assert await client.asks(move_to(AWAY, 50.0)) == cb.MoveAccepted()
        await eventually(controller.unit.is_moving)
        controller.signals["di_gate"].value = False
        await eventually(lambda: not controller.unit.is_moving())
        report = await client.asks(cb.GetStatus())
        assert isinstance(report, cb.Report)
        assert not controller.armed
        await eventually(lambda: value(controller, "cell_done_status") == Status.INTERLOCK)


async def test_a_name_the_controller_does_not_know_arms_nothing_and_says_so_in_the_log(tmp_path: Path) -> None:
    named = {"cell_interlock": ["di_nowhere", "", "", ""]}
    async with running(tmp_path, settings=named) as controller, client_of(controller) as client:
        welcome = await client.asks(cb.Hello(1, 1, 9))
        assert isinstance(welcome, cb.Welcome)
        assert await client.asks(cb.SetArmed(welcome.session, True)) == cb.Refused(Status.INTERLOCK)
        assert any("a signal that CELL_shared names" in entry.text for entry in controller.log)


@pytest.mark.slow
async def test_after_a_power_failure_motion_is_held_until_the_motion_task_has_dropped_the_move(tmp_path: Path) -> None:
    async with running(tmp_path, time_scale=1.0) as controller:
        async with client_of(controller) as client:
            await client.is_armed()
            assert await client.asks(move_to(AWAY, 50.0)) == cb.MoveAccepted()
            await eventually(controller.unit.is_moving)
        held: list[tuple[bool, bool]] = []

        def note() -> None:
            held.append((bool(value(controller, "cell_held")), bool(value(controller, "cell_abort"))))

        controller.memory["cell_held"].watchers += (note,)
        departures = controller.arm.departures
        await asyncio.to_thread(controller.fail_power, controller.clock())
        await eventually(lambda: not controller.unit.is_moving())  # it brakes
        standing = controller.unit.joints_now()
        await eventually(lambda: len(held) == 1)
        controller.recover(controller.clock())
        await eventually(lambda: len(held) == 2)
        assert [holds for holds, _ in held] == [True, False]
        assert not held[-1][1], "released after the abort was answered"
        np.testing.assert_array_equal(controller.unit.joints_now(), standing)
        assert controller.arm.departures == departures
        async with client_of(controller) as client:
            await client.is_armed()
            assert await client.moves(move_to(AWAY, 1000.0)) is Status.OK


@pytest.mark.slow
async def test_position_streams_while_the_motion_part_is_called_and_no_identity_stays_taken(tmp_path: Path) -> None:
    production = PRODUCTION.replace("cell_motion;", "cell_motion_egm;")
    async with running(tmp_path, production=production, egm=True) as controller:
        await eventually(lambda: value(controller, "turns") > 2)
        for _ in range(5):
            async with client_of(controller) as client:
                await client.is_armed()
                # T_HANDEYED answers; T_ROB1 calls the motion part at its next turn.
                await eventually(lambda: {session.state for session in controller.unit.egm.values()} == {"streams"})
                assert await client.asks(cb.Bye()) == cb.Farewell()
            await eventually(lambda: not controller.unit.egm)
        assert error_codes(controller) == []


def error_codes(controller: RapidController) -> list[int]:
    """Event numbers of errors."""
    return [entry.code for entry in controller.log if entry.code not in (0, 80003)]
