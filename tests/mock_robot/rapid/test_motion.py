"""Motion programs on the simulated arm: what moves, what stops it, and what a controller makes of errors."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.rapid.controller import DEPLOYED, RapidController
from tests.mock_robot.controller_client import ARM, AWAY, HOME
from tests.support.waiting import eventually_blocking

SYS = """SYS:CFG_1.0:6:0::
CAB_TASKS:
      -Name "T_BACK" -Type "SEMISTATIC" -TrustLevel "None"
CAB_TASK_MODULES:
      -File "HOME:/x/shared.sys" -ModName "shared" -Shared
      -File "HOME:/x/motion.mod" -ModName "motion" -Task "T_ROB1"
      -File "HOME:/x/back.mod" -ModName "back" -Task "T_BACK"
"""
SHARED = """MODULE shared(SYSMODULE)
  PERS num stage := 0;
  PERS num bell := 0;
  PERS num order := 0;
  PERS num count := 0;
ENDMODULE
"""
BACK = """MODULE back
  PROC main()
    WaitUntil order <> 0 \\PollRate:=0.04;
    IF order = 1 StopMove \\AllMotionTasks;
    IF order = 2 StartMove \\AllMotionTasks;
    count := count + 1;
    order := 0;
  ERROR
    order := 0;
    TRYNEXT;
  ENDPROC
ENDMODULE
"""


def axes(joints: np.ndarray) -> str:
    inner = ", ".join(f"{angle:.6f}" if angle >= 0 else f"-{-angle:.6f}" for angle in np.degrees(joints))
    return f"[[{inner}], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]]"


def program(body: str, trap: str = "stage := 90;") -> str:
    return f"""MODULE motion
  VAR intnum number;
  CONST jointtarget away := {axes(AWAY)};
  CONST jointtarget home := {axes(HOME)};
  CONST jointtarget broken := [[0, 200, 0, 0, 0, 0], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]];
  VAR robtarget goal;
  VAR jointtarget found;
  PROC main()
    IDelete number;
    CONNECT number WITH on_bell;
    IPers bell, number;
    {body}
    WHILE TRUE DO
      WaitTime 0.1;
    ENDWHILE
  ERROR
    stage := -ERRNO;
    TRYNEXT;
  ENDPROC
  TRAP on_bell
    {trap}
  ENDTRAP
ENDMODULE
"""


@contextmanager
def running(folder: Path, text: str, time_scale: float = 20.0) -> Iterator[RapidController]:
    (folder / "rw6").mkdir()
    for name, content in (("rw6/SYS.cfg", SYS), ("shared.sys", SHARED), ("motion.mod", text), ("back.mod", BACK)):
        (folder / name).write_text(content)
    for name in ("rw6/EIO.cfg", "rw6/SIO.cfg"):
        (folder / name).write_text((DEPLOYED / name).read_text())
    arm = SimulatedArm(ARM, HOME, ArmNoise())
    controller = RapidController(arm, 1, time_scale, monotonic(), folder=folder)
    try:
        controller.begin()
        yield controller
    finally:
        controller.end()


def stage(controller: RapidController) -> float:
    return float(controller.memory["stage"].value)


def joints_of(controller: RapidController) -> np.ndarray:
    joints: np.ndarray = controller.unit.joints_now()
    return joints


def test_moves_end_where_they_are_sent_and_the_program_goes_on_then(tmp_path: Path) -> None:
    body = """MoveAbsJ away, v1000, fine, tool0;
    stage := 1;
    goal := CalcRobT(home, tool0 \\WObj:=wobj0);
    MoveJ goal, v1000, fine, tool0 \\WObj:=wobj0;
    found := CalcJointT(CRobT(\\Tool:=tool0 \\WObj:=wobj0), tool0 \\WObj:=wobj0);
    IF Abs(found.robax.rax_5 - home.robax.rax_5) < 0.001 stage := 2;"""
    with running(tmp_path, program(body)) as controller:
        eventually_blocking(lambda: stage(controller) == 2)
        np.testing.assert_allclose(joints_of(controller), HOME, atol=1e-5)
        assert controller.moves_accepted == 2


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("MoveAbsJ broken, v1000, fine, tool0;", 50027),
        ("goal := CalcRobT(home, tool0);\ngoal.trans.x := 5000;\nMoveJ goal, v1000, fine, tool0;", 50050),
        ("goal := CalcRobT(home, tool0);\ngoal.robconf.cf1 := 3;\nMoveL goal, v1000, fine, tool0;", 50080),
    ],
)
def test_a_move_that_cannot_be_stops_the_program_with_abbs_number(tmp_path: Path, body: str, code: int) -> None:
    with running(tmp_path, program(body + "\nstage := 1;")) as controller:
        eventually_blocking(lambda: not controller.panel.program_running)
        assert [entry.code for entry in controller.log] == [code]
        assert stage(controller) == 0
        assert controller.arm.departures == 0


def test_a_path_is_cleared_only_of_an_arm_that_was_stopped(tmp_path: Path) -> None:
    with running(tmp_path, program("MoveAbsJ away, v100, fine, tool0;", "ClearPath;"), time_scale=1.0) as controller:
        eventually_blocking(controller.unit.is_moving)
        controller.memory["bell"].value = 1.0
        eventually_blocking(lambda: not controller.panel.program_running)
        assert "StopMove comes first" in controller.log[0].text


def test_a_target_out_of_reach_is_an_error_one_can_handle(tmp_path: Path) -> None:
    body = """goal := CalcRobT(home, tool0);
    goal.trans.x := 5000;
    found := CalcJointT(goal, tool0);
    IF stage < 0 stage := 7;"""
    with running(tmp_path, program(body)) as controller:
        eventually_blocking(lambda: stage(controller) == 7)
        assert controller.panel.program_running


def test_a_trap_runs_during_a_move_and_the_move_goes_on(tmp_path: Path) -> None:
    body = "MoveAbsJ away, v100, fine, tool0;\n    stage := stage + 1;"
    with running(tmp_path, program(body), time_scale=2.0) as controller:
        eventually_blocking(controller.unit.is_moving)
        controller.memory["bell"].value = 1.0
        eventually_blocking(lambda: stage(controller) == 90)
        assert controller.unit.is_moving()
        controller.time_scale, controller.started_at_s = 200.0, monotonic() - controller.unit.now_s() / 200.0
        eventually_blocking(lambda: stage(controller) == 91)
        np.testing.assert_allclose(joints_of(controller), AWAY, atol=1e-5)


@pytest.mark.parametrize(("clears", "ends_at"), [("", AWAY), ("ClearPath;", None)])
def test_a_stopped_move_goes_on_with_startmove_unless_its_path_is_cleared(
    tmp_path: Path, clears: str, ends_at: Any
) -> None:
    trap = f"StopMove;\n    {clears}\n    WaitTime \\InPos, 0.3;\n    stage := 50;\n    WaitTime 1;\n    StartMove;"
    body = "MoveAbsJ away, v100, fine, tool0;\n    stage := stage + 1;"
    with running(tmp_path, program(body, trap), time_scale=4.0) as controller:
        eventually_blocking(controller.unit.is_moving)
        controller.memory["bell"].value = 1.0
        eventually_blocking(lambda: stage(controller) == 50)
        assert not controller.unit.is_moving()
        eventually_blocking(lambda: stage(controller) == 51)
        if ends_at is None:
            assert np.abs(joints_of(controller) - AWAY).max() > 0.01
        else:
            np.testing.assert_allclose(joints_of(controller), ends_at, atol=1e-5)


def test_what_was_interrupted_goes_on_when_the_program_is_started_again(tmp_path: Path) -> None:
    """As on a controller. The shipped program must not rely on anything else."""
    body = "MoveAbsJ away, v1000, fine, tool0;\n    stage := 1;"
    with running(tmp_path, program(body), time_scale=1.0) as controller:
        eventually_blocking(controller.unit.is_moving)
        controller.press_emergency_stop(True, monotonic())
        eventually_blocking(lambda: not controller.unit.is_moving())
        standing = joints_of(controller)
        controller.press_emergency_stop(False, monotonic())
        controller.switch_motors(True, monotonic())
        departures = controller.arm.departures
        np.testing.assert_array_equal(joints_of(controller), standing)
        assert (controller.arm.departures, controller.unit.is_moving()) == (departures, False)
        controller.run_program(True, monotonic())
        eventually_blocking(lambda: stage(controller) == 1)
        np.testing.assert_allclose(joints_of(controller), AWAY, atol=1e-5)


def test_a_move_that_has_arrived_is_over_though_motion_is_stopped_and_permitted_again(tmp_path: Path) -> None:
    with running(tmp_path, program("MoveAbsJ away, v1000, fine, tool0;\n    stage := 1;")) as controller:
        eventually_blocking(lambda: stage(controller) == 1)
        controller.press_emergency_stop(True, monotonic())
        controller.press_emergency_stop(False, monotonic())
        controller.recover(monotonic())
        for order in (1.0, 2.0):  # StopMove, then StartMove of the other task
            controller.memory["order"].value = order
            eventually_blocking(lambda: controller.memory["order"].value == 0)
        assert controller.memory["count"].value == 2
        assert controller.arm.departures == 1


def test_another_task_holds_all_motion_until_it_lets_go(tmp_path: Path) -> None:
    body = (
        "WHILE stage = 0 DO\n      WaitTime 0.1;\n    ENDWHILE\n    MoveAbsJ away, v1000, fine, tool0;\n    stage := 2;"
    )
    with running(tmp_path, program(body)) as controller:
        controller.memory["order"].value = 1.0
        eventually_blocking(lambda: controller.memory["count"].value == 1)
        controller.memory["stage"].value = 1.0
        eventually_blocking(lambda: controller.moves_accepted == 1)
        assert controller.arm.departures == 0
        controller.memory["order"].value = 2.0
        eventually_blocking(lambda: stage(controller) == 2)
        assert controller.arm.departures == 1


def test_a_restart_keeps_pers_and_nothing_else(tmp_path: Path) -> None:
    with running(tmp_path, program("stage := stage + 1;")) as controller:
        eventually_blocking(lambda: stage(controller) == 1)
        controller.restart(monotonic())
        eventually_blocking(lambda: stage(controller) == 2)
