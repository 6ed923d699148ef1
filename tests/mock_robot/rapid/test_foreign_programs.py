"""Programs of other people in a folder of theirs: signals, names, and an arm that a sensor guides by EGM."""

import inspect
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from calibration.transforms import Array
from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.rapid.controller import RapidController
from mock_robot.rapid.program import builtins
from protocols.egm.messages import Correction, decode, decode_correction
from tests.mock_robot.controller_client import ARM, HOME
from tests.mock_robot.rapid import customer_program
from tests.mock_robot.rapid.sensor import encode_correction
from tests.support.waiting import eventually_blocking

SIGNALS = """EIO:CFG_1.0:6:1::
#
EIO_SIGNAL:

      -Name "gi_number" -SignalType "GI"
      -Name "ao_speed" -SignalType "AO"
      -Name "di_ready" -SignalType "DI"
      -Name "do_done" -SignalType "DO"
"""
FIELD = """MODULE field
  LOCAL VAR num hidden := 1;
  PERS num sum := 0;
  PERS num own := 0;
  PROC main()
    WaitUntil di_ready = 1 \\PollRate:=0.04;
    sum := gi_number + di_ready + ao_speed;
    own := hidden;
    SetDO do_done, 1;
    WaitDO do_done, 1 \\MaxTime:=5;
    WaitTime 1000;
  ENDPROC
ENDMODULE
"""
BESIDE = "MODULE beside\n  LOCAL VAR num hidden := 2;\nENDMODULE\n"
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


def test_signals_of_every_kind_are_numbers_and_a_local_name_hides_that_of_another_module(tmp_path: Path) -> None:
    with home_running(tmp_path, {"field": FIELD, "beside": BESIDE}, EIO=SIGNALS) as controller:
        controller.signals["gi_number"].value = 5.0
        controller.signals["ao_speed"].value = 2.5
        controller.signals["di_ready"].value = True
        eventually_blocking(lambda: bool(controller.signals["do_done"].value))
        assert [controller.memory[name].value for name in ("sum", "own")] == [8.5, 1]


@dataclass(frozen=True)
class Guidance:
    """What a client chooses, what its sensor answers each position with, and where the flange then ends, in mm."""

    number: float
    correction: Correction
    ends_mm: Array
    ends_itself: bool = False


READY = np.radians([10.0, 15.0, 0.0, 30.0, 65.0, 30.0])
TURNED = READY + np.radians([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
BEGINS_MM, FLANGE_Z = ARM.forward(READY)[:3, 3], ARM.forward(READY)[:3, 2]
Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
ALONG_MM = 100.0 * Y
SEAM_Z = (FLANGE_Z - (FLANGE_Z @ Y) * Y) / np.linalg.norm(FLANGE_Z - (FLANGE_Z @ Y) * Y)
BESIDE_SEAM_MM = 4.0 * np.cross(SEAM_Z, Y) + 6.0 * SEAM_Z
GUIDANCES = {
    "positions": Guidance(0, Correction(1), BEGINS_MM + ALONG_MM, ends_itself=True),
    "joints": Guidance(1, Correction(1, tuple(np.degrees(TURNED))), ARM.forward(TURNED)[:3, 3]),
    "tool": Guidance(2, Correction(1, (), tuple(BEGINS_MM + 20.0 * Y + 50.0 * Z), (1, 0, 0, 0)), BEGINS_MM + 20.0 * Y),
    "seam": Guidance(
        3, Correction(1, across_path_mm=(0.0, 4.0, 6.0)), BEGINS_MM + ALONG_MM + BESIDE_SEAM_MM, ends_itself=True
    ),
}


@pytest.mark.parametrize("kind", GUIDANCES)
def test_a_customers_program_is_guided_as_its_client_chooses(tmp_path: Path, kind: str) -> None:
    guidance = GUIDANCES[kind]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.bind(("127.0.0.1", 0))
        sensor.settimeout(0.2)
        sio = SIO.replace("{port}", str(sensor.getsockname()[1]))
        with home_running(
            tmp_path, {"customer": customer_program.PROGRAM}, EIO=customer_program.SIGNALS, SIO=sio
        ) as controller:
            controller.signals["gi_guidance"].value = guidance.number
            controller.signals["di_begin"].value = True

            def answers_until_the_end() -> bool:
                with suppress(TimeoutError):
                    data, robot = sensor.recvfrom(2048)
                    sensor.sendto(encode_correction(guidance.correction), robot)
                    left_mm = np.linalg.norm(guidance.ends_mm - decode(data).position_mm)
                    if guidance.ends_itself or left_mm < 0.1:
                        controller.signals["do_enough"].value = True
                return bool(controller.memory["ended"].value) or not controller.panel.program_running

            eventually_blocking(answers_until_the_end)
            assert controller.memory["ended"].value, controller.log[-1]
            flange = controller.unit.world_T_flange(controller.unit.joints_now(), controller.unit.external_axes())
            np.testing.assert_allclose(flange[:3, 3], guidance.ends_mm, atol=0.1)
            assert controller.memory["was_guided"].value is (not guidance.ends_itself)


STREAMS = """MODULE streams
  VAR egmident id;
  PROC main()
    EGMReset id;
    EGMGetId id;
    EGMSetupUC ROB_1, id, "default", "UCdevice" \\Joint;
    EGMStreamStart id;
    WaitTime 1000;
  ENDPROC
ENDMODULE
"""


def test_the_pointer_at_main_frees_egm(tmp_path: Path) -> None:
    """Upstream's tests of abb_robot_client begin each program so, and find no EGM running."""
    with home_running(tmp_path, {"streams": STREAMS}, SIO=SIO.replace("{port}", "9")) as controller:
        eventually_blocking(lambda: bool(controller.unit.egm and controller.unit.egm_ports))
        ports = dict(controller.unit.egm_ports)
        controller.run_program(False, controller.clock())
        controller.move_pointer_to_main(controller.clock())
        assert not controller.unit.egm
        controller.run_program(True, controller.clock())
        eventually_blocking(lambda: bool(controller.unit.egm))
        assert controller.unit.egm_ports == ports


def test_a_cycle_that_is_asked_for_once_ends_with_the_program(tmp_path: Path) -> None:
    text = "MODULE count\nPERS num rounds := 0;\nPROC main()\nrounds := rounds + 1;\nENDPROC\nENDMODULE\n"
    with home_running(tmp_path, {"count": text}) as controller:
        eventually_blocking(lambda: controller.memory["rounds"].value > 1)
        controller.run_program(False, controller.clock())
        controller.panel.cycle = "once"
        controller.move_pointer_to_main(controller.clock())
        eventually_blocking(lambda: not any(controller.whereabouts().values()))  # the statement under way has ended
        before = controller.memory["rounds"].value
        controller.run_program(True, controller.clock())
        eventually_blocking(lambda: controller.memory["rounds"].value > before)
        eventually_blocking(lambda: not controller.panel.program_running)
        assert controller.memory["rounds"].value == before + 1


@pytest.mark.parametrize(
    "correction",
    [Correction(3, (1.0, 2.0, 3.0)), Correction(4, (), (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)),
     Correction(5, across_path_mm=(0.0, 1.5, -2.0))],
)  # fmt: skip
def test_a_correction_is_read_as_it_was_sent(correction: Correction) -> None:
    assert decode_correction(encode_correction(correction)) == correction


def test_every_instruction_takes_what_its_header_passes() -> None:
    for builtin in builtins():
        passed = [each for each in builtin.parameters if each.name not in builtin.left_out]
        inspect.signature(builtin.does).bind(None, *passed)
