"""abb-robot-client 0.4 (rpiRobotics), unmodified: RWS 1.0 with events."""

from collections.abc import Iterator

import numpy as np
import pytest

from mock_robot.cabinet.panel import Mode
from tests.foreign.client_checks import digits, held_by, move
from tests.mock_robot.controller_client import AWAY
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart
from tests.support.waiting import eventually_blocking

rws = pytest.importorskip("abb_robot_client.rws", reason="abb-robot-client is not installed")


@pytest.fixture
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart() as running:
        yield running


@pytest.fixture
def client(cell: RwsCell) -> Iterator[rws.RWS]:
    connected = rws.RWS(cell.first)
    yield connected
    connected.close()


def test_it_reads_what_the_mock_holds(cell: RwsCell, client: rws.RWS) -> None:
    assert client.get_controller_state() == "motoron"
    assert client.get_operation_mode() == "AUTO"
    assert client.get_execution_state().ctrlexecstate == "running"
    assert client.get_speedratio() == 100.0
    tasks = client.get_tasks()
    assert {name: task.motiontask for name, task in tasks.items()} == {"T_ROB1": True, "T_HANDEYED": False}
    assert client.get_rapid_variable("user/reg1") == "0"
    cell.does(lambda: cell.controller.press_emergency_stop(True, cell.cell.clock()))
    newest = client.read_event_log()[0]
    assert (newest.msgtype, newest.code, newest.title) == (1, 10013, "emergency stop pressed")


def test_pose_and_joints_are_the_mocks_to_the_last_digit_before_and_after_a_move(
    cell: RwsCell, client: rws.RWS
) -> None:
    for _ in range(2):
        target, joints = client.get_robtarget(), client.get_jointtarget()
        assert digits([*target.trans, *target.rot]) == list(held_by(cell).values())
        assert tuple(target.robconf) == cell.world.configuration
        assert np.all(target.extax > 8.9e9)
        assert np.allclose(joints.robax, cell.world.joints_deg, rtol=0, atol=1e-5)
        move(cell, AWAY)


def test_its_writes_change_the_mock_and_its_motion_stops(cell: RwsCell, client: rws.RWS) -> None:
    client.set_rapid_variable("reg1", "42")
    assert cell.world.memory.symbols["T_ROB1/user/reg1"].value == "42"
    client.set_digital_io("do_spare", 1)
    assert client.get_digital_io("do_spare") == 1
    client.stop()
    assert cell.world.execution_state == "stopped"
    client.resetpp()
    client.start(cycle="once", tasks=["T_ROB1"])
    assert cell.world.execution_state == "running"
    client.upload_file("$HOME/x.txt", b"abc")
    assert client.read_file("$HOME/x.txt") == b"abc"
    assert client.list_files("$HOME") == ["x.txt"]
    client.delete_file("$HOME/x.txt")
    assert cell.world.volumes.files == {}
    client.set_speedratio(50)
    assert cell.controller.panel.speed_override == 0.5


def test_events_of_six_kinds_arrive(cell: RwsCell, client: rws.RWS) -> None:
    kind, priority, request = (
        rws.SubscriptionResourceType,
        rws.SubscriptionResourcePriority,
        rws.SubscriptionResourceRequest,
    )
    events: list[object] = []
    subscription = client.subscribe(
        [
            request(kind.ControllerState, priority.Medium),
            request(kind.OperationalMode, priority.Medium),
            request(kind.ExecutionState, priority.Medium),
            request(kind.PersVar, priority.High, "reg1"),
            request(kind.Elog, priority.Medium),
            request(kind.Signal, priority.High, "do_spare"),
        ],
        events.append,
    )
    eventually_blocking(lambda: any(group.taken for group in cell.cell.rws.first.subscriptions.groups.values()))
    client.set_digital_io("do_spare", 1)
    client.set_rapid_variable("reg1", "7")
    client.stop()
    client.set_controller_state("motoroff")
    cell.does(lambda: cell.controller.switch_mode(Mode.MANR, cell.cell.clock()))
    eventually_blocking(lambda: {type(event).__name__ for event in events} >= {
        "Signal", "VariableValue", "RAPIDExecutionState", "ControllerState", "OperationalMode", "EventLogEntryEvent"
    })  # fmt: skip
    assert rws.Signal("do_spare", "1") in events
    assert rws.ControllerState("motoroff") in events
    assert rws.OperationalMode("MANR") in events
    assert rws.RAPIDExecutionState("stopped", "") in events
    subscription.close()


def test_a_rule_that_is_broken_gets_the_controllers_number(cell: RwsCell, client: rws.RWS) -> None:
    def code(act: object, *arguments: object) -> int:
        with pytest.raises(rws.ABBException) as refused:
            act(*arguments)  # type: ignore[operator]
        return int(refused.value.code)

    assert code(client.get_rapid_variable, "nothing") == -1073414146
    assert code(client.get_digital_io, "nothing") == -1073445866
    assert code(client.set_digital_io, "di_part", 1) == -1073445881
    assert code(client.resetpp) == -1073442809  # the program runs
    assert code(client.get_robtarget, "ROB_9") == -1073414146
    cell.does(lambda: cell.cell.inject_fault("rws-mastership-held"))
    assert code(client.set_rapid_variable, "reg1", "1") == -1073445862
    cell.does(cell.cell.clear_faults)
    cell.does(lambda: cell.controller.switch_mode(Mode.MANR, cell.cell.clock()))
    assert code(client.set_rapid_variable, "reg1", "1") == -1073445881


def test_in_manual_mode_the_operators_consent_lets_it_write(cell: RwsCell, client: rws.RWS) -> None:
    """Its own poll of the consent doubles `json=1` and the address: a request by hand, in its session, instead."""
    cell.does(lambda: cell.controller.switch_mode(Mode.MANR, cell.cell.clock()))
    cell.world.mastership.operator_says = True
    client._do_post("users/rmmp", {"privilege": "modify"})
    client.set_rapid_variable("reg1", "3")
    assert cell.world.memory.symbols["T_ROB1/user/reg1"].value == "3"
