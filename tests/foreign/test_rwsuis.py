"""rwsuis 0.2 (University of Stavanger), unmodified: RWS 1.0 with a digest that leaves `;value` out."""

from collections.abc import Iterator

import numpy as np
import pytest

from mock_robot.cabinet.panel import Mode
from mock_robot.rws.memory import Symbol
from tests.foreign.client_checks import digits, held_by, quietly
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

RWS = pytest.importorskip("rwsuis.RWS", reason="rwsuis is not installed").RWS
CALIBRATION = "[[515,0,712],[0.707106769,0,0.707106769,0],[0,-1,0,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]"


@pytest.fixture
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart() as running:
        running.world.memory.symbols["T_ROB1/cell/p_cal"] = Symbol("robtarget", CALIBRATION)
        running.world.tools["tGripper"] = running.world.wobjs["wobjTableN"] = np.eye(4)
        yield running


@pytest.fixture
def client(cell: RwsCell) -> Iterator[RWS]:
    connected = RWS(cell.first)
    with quietly():
        yield connected
    connected.session.close()


def test_it_reads_what_the_mock_holds(cell: RwsCell, client: RWS) -> None:
    assert client.get_controller_state() == "motoron"
    assert client.get_operation_mode() == "AUTO"
    assert client.is_running()
    trans, rot = client.get_robtarget_variables("p_cal")
    assert (trans, rot) == ([515, 0, 712], [0.707106769, 0, 0.707106769, 0])


def test_the_pose_of_its_gripper_is_the_mocks_to_the_last_digit(cell: RwsCell, client: RWS) -> None:
    trans, rot = client.get_gripper_position()
    assert digits([*trans, *rot]) == list(held_by(cell).values())
    assert cell.cell.rws.first.sessions.count == 1


def test_it_stops_starts_and_writes(cell: RwsCell, client: RWS) -> None:
    client.stop_RAPID()
    assert cell.world.execution_state == "stopped"
    client.start_RAPID()
    assert cell.world.execution_state == "running"
    client.set_robtarget_translation("p_cal", [1, 2, 3])
    value = cell.world.memory.symbols["T_ROB1/cell/p_cal"].value
    assert value.startswith("[[1,2,3],[0.707106769,0,0.707106769,0],[-1,0,0,0]")  # its own fixed configuration
    client.set_speed_ratio(40)
    assert cell.controller.panel.speed_override == 0.4


def test_in_manual_mode_its_motors_stay_off_and_it_says_why(cell: RwsCell) -> None:
    cell.does(lambda: cell.controller.switch_mode(Mode.MANR, cell.cell.clock()))
    cell.does(lambda: cell.controller.switch_motors(False, cell.cell.clock()))
    client = RWS(cell.first)
    with quietly() as said:
        client.motors_on()
    client.session.close()
    assert "manual mode" in said.getvalue()
    assert not cell.controller.panel.motors_on
