"""Configuration fragments: what a controller would refuse is refused by name, and the shipped ones are not."""

import shutil
from pathlib import Path

import pytest

from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.rapid.configuration import Fragments, serial_ports, signals, task_plans
from mock_robot.rapid.controller import DEPLOYED, RapidController
from mock_robot.rapid.errors import RapidProgramError
from tests.mock_robot.controller_client import ARM, HOME

EXPORTED_BY_AN_IRC5 = """EIO:CFG_1.0:6:1::
#
SYSSIG_OUT:

      -Status "MotOnState" -Signal "doMotorsOn"

      -Status "TaskExecuting" -Signal "doRuns" -Arg2 "T_ROB1"
#
EIO_SIGNAL:

      -Name "doMotorsOn" -SignalType "DO" -Device "PN_Internal_Device"\\
      -Label "motors" -DeviceMap "1" -Size 1

      -Name "doRuns" -SignalType "DO" -Access "ReadOnly" -Default 1 -Invert
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(DEPLOYED, tmp_path / "rapid"))


def load(folder: Path, robotware: int = 6) -> None:
    RapidController(SimulatedArm(ARM, HOME, ArmNoise()), 1, folder=folder, robotware=robotware).begin()


@pytest.mark.parametrize(
    ("file", "sound", "wrong", "why"),
    [
        ("rw6/EIO.cfg", "MotOnState", "MotorsMaybe", "MotorsMaybe is unknown"),
        ("rw6/EIO.cfg", '-Signal "cell_do_motors"', '-Signal "nothing"', "no signal is named nothing"),
        ("rw6/EIO.cfg", '-Signal "cell_do_motors"', '-Name "cell_do_motors"', "SYSSIG_OUT has no attribute Name"),
        (
            "rw7/EIO.cfg",
            '-Name "cell_do_motors" -SignalType',
            '-Name "x" -SignalType',
            "no signal is named cell_do_mot",
        ),
        ("rw7/EIO.cfg", '-Status "EmStop" -Name', '-Status "EmStop" -Signal', "SYSSIG_OUT has no attribute Signal"),
        (
            "rw6/EIO.cfg",
            '"cell_do_running" -Arg2 "T_ROB1"',
            '"cell_do_running" -Arg1 "T_ROB1"',
            "system output TaskExecuting takes Arg2",
        ),
        (
            "rw6/EIO.cfg",
            '"cell_do_estop"\n',
            '"cell_do_estop" -Arg1 "ROB_1"\n',
            "system output EmStop takes no argument",
        ),
        ("rw6/EIO.cfg", "EIO:CFG_1.0:6:1::", "EIO:CFG_1.0:5:0::", "is no header of RobotWare 6"),
        ("rw7/EIO.cfg", "EIO:CFG_1.0::", "EIO:CFG_1.0:6:1::", "is no header of RobotWare 7"),
        ("rw7/EIO.cfg", '-SignalType "DO"', '-SignalType "DO" -Colour "red"', "EIO_SIGNAL has no attribute Colour"),
        ("rw6/EIO.cfg", "EIO_SIGNAL:", "EIO_SIGNALS:", "no type of EIO is named EIO_SIGNALS"),
        ("rw6/SYS.cfg", '-Name "T_HANDEYED"', '-Name "T_ROB1"', "the controller has a task T_ROB1 already"),
        ("rw6/SYS.cfg", "SEMISTATIC", "SOMETIMES", "Type is one of NORMAL"),
        ("rw6/SYS.cfg", '-TrustLevel "None"', '-TrustLevel "NoSafety"', "TrustLevel is one of None"),
        ("rw6/SYS.cfg", "-TrustLevel", "-Trustlevel", "CAB_TASKS has no attribute Trustlevel"),
        ("rw6/SIO.cfg", '-Connector "COM1"', '-Connector "COM1" -Baudrate 115200', "has no attribute Baudrate"),
        ("CELL_shared.sys", "PERS num cell_bell", "VAR num cell_bell", "only PERS and CONST are shared"),
        ("CELL_main.mod", "PROC main()", "PROC mine()", "no module of this task has a PROC main"),
    ],
)
def test_what_a_controller_refuses_is_refused_by_name(
    folder: Path, file: str, sound: str, wrong: str, why: str
) -> None:
    path = folder / file
    text = path.read_bytes().decode("ascii").replace("\r\n", "\n")
    assert sound in text
    path.write_text(text.replace(sound, wrong, 1))
    if file == "rw6/SIO.cfg":
        with pytest.raises(RapidProgramError, match=why):
            serial_ports(Fragments(folder, 6))
        return
    with pytest.raises(RapidProgramError, match=why):
        load(folder, robotware=int(file[2]) if file.startswith("rw") else 6)


def test_a_file_as_a_controller_exports_it_is_read(folder: Path) -> None:
    (folder / "rw6" / "EIO.cfg").write_text(EXPORTED_BY_AN_IRC5)
    executing = []
    outputs = {"MotOnState": lambda _: True, "TaskExecuting": lambda task: executing.append(task) or True}
    found = signals(Fragments(folder, 6), outputs)  # type: ignore[arg-type]
    assert found["doRuns"].read()
    assert found.keys() == {"doMotorsOn", "doRuns"}
    assert executing == ["T_ROB1"]


@pytest.mark.parametrize("robotware", [6, 7])
def test_the_shipped_fragments_load_in_both_and_an_error_of_the_link_task_stops_no_other(robotware: int) -> None:
    fragments = Fragments(DEPLOYED, robotware)
    plans = {plan.name: plan for plan in task_plans(fragments)}
    assert [(plan.name, plan.motion, len(plan.sources)) for plan in plans.values()] == [
        ("T_ROB1", True, 3),
        ("T_HANDEYED", False, 2),
    ]
    assert (plans["T_HANDEYED"].kind, plans["T_HANDEYED"].stops_all) == ("SEMISTATIC", False)
    assert len(fragments.read("EIO")["EIO_SIGNAL"]) == len(fragments.read("EIO")["SYSSIG_OUT"]) == 4
    assert serial_ports(fragments) == (("com1:",) if robotware == 6 else ())
