"""What programs of other people use: signals, arcs, triggers, zones, files, queues, names, and guidance by EGM."""

import inspect
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from mock_robot.arm.paths import circle_through
from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.rapid.controller import RapidController
from mock_robot.rapid.errors import RapidProgramError
from mock_robot.rapid.headers import builtins
from protocols.egm.corrections import Correction, decode_correction, encode_correction
from protocols.egm.messages import decode
from tests.mock_robot.controller_client import ARM, HOME
from tests.mock_robot.rapid.snippets import ran
from tests.support.waiting import eventually_blocking

PROGRAM = """MODULE field
  LOCAL VAR num hidden := 1;
  PERS string done := "";
  PERS num results{14} := [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
  VAR intnum on_way;
  VAR intnum on_group;
  VAR intnum on_message;
  VAR triggdata here;
  VAR wzstationary zone;
  VAR shapedata shape;
  VAR rmqslot slot;
  VAR rmqmessage message;
  VAR iodev file;
  VAR num received;
  VAR robtarget start;
  VAR robtarget middle;
  VAR robtarget aside;
  VAR speeddata quick := [400, 100, 100, 100];
  CONST num table{2, 3} := [[1, 2, 3], [4, 5, 6]];

  PROC main()
    VAR pos place;
    VAR num bound;
    CONNECT on_way WITH passing;
    CONNECT on_group WITH grouped;
    CONNECT on_message WITH got;
    ISignalGO go_number, on_group;
    IRMQMessage received, on_message;
    WaitDI di_ready, 1;
    results{1} := gi_number + di_ready;
    SetGO go_number, 6;
    SetAO ao_speed, 2.5;
    results{2} := ao_speed * 2;
    WZSphDef \\Inside, shape, CPos(\\Tool:=tool0), 30;
    WZDOSet \\Stat, zone \\Inside, shape, do_inside, 1;
    results{3} := do_inside;
    start := CRobT(\\Tool:=tool0 \\WObj:=wobj0);
    middle := Offs(start, -40, 0, 40);
    aside := Offs(start, -80, 0, 0);
    TriggInt here, 10 \\Start, on_way;
    TriggL Offs(start, -20, 0, 0), quick, here, z10, tool0;
    MoveL start, quick, fine \\Inpos:=inpos20, tool0;
    MoveC middle, aside, quick, fine, tool0;
    place := CPos(\\Tool:=tool0);
    results{4} := Round(start.trans.x - place.x);
    results{5} := do_inside;
    MoveL \\Conc, start, quick, fine, tool0;
    results{6} := 1;
    WaitRob \\ZeroSpeed;
    RMQFindSlot slot, "RMQ_T_ROB1";
    RMQSendMessage slot, 42;
    WaitTime 0.1;
    Open "HOME:" \\File:="log.txt", file \\Write;
    Write file, "value " \\Num:=7;
    Close file;
    Open "HOME:/log.txt", file \\Read;
    done := ReadStr(file);
    Close file;
    %"named" + "_later"% \\Twice;
    results{8} := total(table);
    ReadCfgData "/MOC/ARM/rob1_1", "upper_joint_bound", bound;
    results{9} := Round(bound \\Dec:=3);
    PulseDO \\High \\PLength:=0.1, do_pulse;
    WaitDO do_pulse, 0 \\MaxTime:=5;
    results{10} := hidden;
    done := StrFormat("{1}, {2}" \\Arg1:=done \\Arg2:="ended");
    results{11} := 1;
    WaitTime 1000;
  ENDPROC
  LOCAL PROC named_later(\\switch Twice)
    note \\Twice?Twice;
  ENDPROC
  PROC note(\\switch Twice)
    results{7} := 1;
    IF Present(Twice) results{7} := 2;
  ENDPROC
  FUNC num total(num values{*,*})
    VAR num sum := 0;
    FOR row FROM 1 TO Dim(values, 1) DO
      FOR column FROM 1 TO Dim(values, 2) DO
        sum := sum + values{row, column};
      ENDFOR
    ENDFOR
    RETURN sum;
  ENDFUNC
  TRAP passing
    results{12} := results{12} + 1;
  ENDTRAP
  TRAP grouped
    results{13} := go_number;
  ENDTRAP
  TRAP got
    RMQGetMessage message;
    RMQGetMsgData message, received;
    results{14} := received;
  ENDTRAP
ENDMODULE
"""
BESIDE = "MODULE beside\n  LOCAL VAR num hidden := 2;\nENDMODULE\n"
EIO = """EIO:CFG_1.0:6:1::
#
EIO_SIGNAL:

      -Name "gi_number" -SignalType "GI"
      -Name "go_number" -SignalType "GO"
      -Name "ao_speed" -SignalType "AO"
      -Name "di_ready" -SignalType "DI"
      -Name "do_inside" -SignalType "DO"
      -Name "do_pulse" -SignalType "DO"
"""
MOC = 'MOC:CFG_1.0:6:1::\n#\nARM:\n\n      -name "rob1_1" -upper_joint_bound 2.87979\n'
SIO = """SIO:CFG_1.0:6:1::
#
COM_TRP:

      -Name "UCdevice" -Type "UDPUC" -RemoteAdress "192.0.2.9" -RemotePortNumber {port}
"""


@contextmanager
def home_running(folder: Path, modules: dict[str, str], **configuration: str) -> Iterator[RapidController]:
    for name, text in modules.items():
        (folder / f"{name}.mod").write_text(text)
    for domain, text in configuration.items():
        (folder / f"{domain}.cfg").write_text(text)
    arm = SimulatedArm(ARM, HOME, ArmNoise())
    controller = RapidController(arm, 1, 20.0, monotonic(), folder=folder, home=True)
    try:
        controller.begin()
        yield controller
    finally:
        controller.end()


def test_a_program_finds_what_it_would_on_a_controller(tmp_path: Path) -> None:
    modules = {"field": PROGRAM, "beside": BESIDE}
    with home_running(tmp_path, modules, EIO=EIO, MOC=MOC) as controller:
        controller.signals["gi_number"].value = 5
        controller.signals["di_ready"].value = True
        results = controller.memory["results"]
        eventually_blocking(lambda: results.value[10] == 1 or not controller.panel.program_running)
        assert [entry.text for entry in controller.log if "stopped at" in entry.text] == []
        assert results.value == [6, 5, 1, 80, 0, 1, 2, 21, pytest.approx(2.88), 1, 1, 1, 6, 42]
        assert controller.memory["done"].value == "value 7, ended"
        assert controller.disk.files == {"HOME/log.txt": b"value 7\n"}


GUIDED = """MODULE guided
  VAR egmident id;
  CONST egm_minmax close := [-0.05, 0.05];
  PERS num stage := 0;
  PROC main()
    EGMReset id;
    EGMGetId id;
    EGMSetupUC ROB_1, id, "default", "UCdevice" {mode} \\CommTimeout:=20;
    {act}
    stage := EGMGetState(id);
    {run}
    stage := 10;
    EGMReset id;
    WaitTime 1000;
  ENDPROC
ENDMODULE
"""
JOINT = {
    "mode": "\\Joint",
    "act": "EGMActJoint id \\J1:=close \\MaxSpeedDeviation:=30;",
    "run": "EGMRunJoint id, EGM_STOP_HOLD \\J1 \\CondTime:=0.5;",
}
POSE = {
    "mode": "\\Pose",
    "act": "EGMActPose id \\Tool:=tool0 \\WObj:=wobj0, [[0,0,0],[1,0,0,0]], EGM_FRAME_WOBJ, "
    "[[0,0,0],[1,0,0,0]], EGM_FRAME_WOBJ \\x:=close \\y:=close \\z:=close \\MaxSpeedDeviation:=30;",
    "run": "EGMRunPose id, EGM_STOP_HOLD \\x \\y \\z \\CondTime:=0.5;",
}


@pytest.mark.parametrize("program", [JOINT, POSE], ids=["joint", "pose"])
def test_a_sensor_guides_the_arm_until_it_stands_where_it_was_sent(tmp_path: Path, program: dict[str, str]) -> None:
    text = GUIDED
    for name, part in program.items():
        text = text.replace("{" + name + "}", part)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.bind(("127.0.0.1", 0))
        sensor.settimeout(0.2)
        port = sensor.getsockname()[1]
        with home_running(tmp_path, {"guided": text}, SIO=SIO.replace("{port}", str(port))) as controller:
            stage, seen = controller.memory["stage"], []
            while stage.value < 10 and controller.panel.program_running:
                try:
                    data, robot = sensor.recvfrom(2048)
                except TimeoutError:
                    continue  # the program may have ended meanwhile
                seen.append(decode(data))
                first = seen[0]
                x, y, z = first.position_mm
                goal = (first.joints_deg[0] + 3.0, *(first.joints_deg[1:]))
                correction = (
                    Correction(1, goal) if program is JOINT else Correction(1, (), (x, y + 20.0, z), (1, 0, 0, 0))
                )
                sensor.sendto(encode_correction(correction), robot)
            assert stage.value == 10
            joints_deg = np.degrees(controller.unit.joints_now())
            if program is JOINT:
                np.testing.assert_allclose(joints_deg, goal, atol=0.06)
            else:
                flange = controller.unit.world_T_flange(np.radians(joints_deg), controller.unit.external_axes())
                np.testing.assert_allclose(flange[:3, 3], (x, y + 20.0, z), atol=0.1)


def test_a_sensor_that_sends_nothing_ends_the_guidance(tmp_path: Path) -> None:
    text = GUIDED.replace("CommTimeout:=20", "CommTimeout:=0.2")
    for name, part in JOINT.items():
        text = text.replace("{" + name + "}", part)
    with home_running(tmp_path, {"guided": text}, SIO=SIO.replace("{port}", "9")) as controller:
        eventually_blocking(lambda: not controller.panel.program_running)
        assert "ERR_UDPUC_COMM" in controller.log[-1].text


@pytest.mark.parametrize(
    "correction",
    [Correction(3, (1.0, 2.0, 3.0)), Correction(4, (), (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)),
     Correction(5, across_path_mm=(0.0, 1.5, -2.0))],
)  # fmt: skip
def test_a_correction_is_read_as_it_was_sent(correction: Correction) -> None:
    assert decode_correction(encode_correction(correction)) == correction


def test_an_arc_passes_its_three_points() -> None:
    first, via, last = np.array([100.0, 0, 0]), np.array([0, 100.0, 0]), np.array([0, -100.0, 0])
    found = circle_through(first, via, last)
    assert found is not None
    centre, axis, turn = found
    np.testing.assert_allclose(centre, np.zeros(3), atol=1e-9)
    assert (round(float(axis[2])), np.degrees(turn)) == (1, pytest.approx(270.0))
    assert circle_through(first, 2 * first, 3 * first) is None


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('%"nothing"%;', "ERR_REFUNKPRC"),
        ("result := StrToByte(\"300\");", "ERR_ARGVALERR"),
        ('SiConnect device;', "ERR_COMM_INIT_FAILED"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_an_error_of_its_name(body: str, words: str) -> None:
    data = 'VAR byte result;\nVAR string error := "";\nPERS sensor device := [1, 0, 0];'
    handler = f'IF ERRNO = {words} error := "{words}";\nTRYNEXT;'
    assert ran(body, data, handler)["error"] == words


def test_a_name_stands_in_the_place_of_its_parameter() -> None:
    data = "VAR robtarget point;\nVAR robtarget result;"
    assert ran("result := Offs(Point:=point, 1, 2, 3);", data)["result"][0] == [1, 2, 3]
    with pytest.raises(RapidProgramError, match="stands in the place of"):
        ran("result := Offs(Wrong:=point, 1, 2, 3);", data)


def test_every_instruction_takes_what_its_header_passes() -> None:
    for builtin in builtins():
        passed = [each for each in builtin.parameters if each.name not in builtin.left_out]
        inspect.signature(builtin.does).bind(None, *passed)
