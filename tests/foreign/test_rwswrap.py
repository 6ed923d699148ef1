"""rwswrap 0.1.0 (PyPI), unmodified: RWS 2.0 over HTTPS with a certificate nobody vouches for."""

from collections.abc import Iterator

import pytest

from tests.foreign.client_checks import held_by, quietly, unverified_https
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

RWS = pytest.importorskip("rwswrap.RWS", reason="rwswrap is not installed").RWS


@pytest.fixture
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart() as running:
        yield running


@pytest.fixture
def client(cell: RwsCell) -> Iterator[RWS]:
    connected = RWS(cell.second, username="Admin", module="user")
    with quietly(), unverified_https():
        yield connected
    connected.session.close()


def test_it_reads_what_the_mock_holds(cell: RwsCell, client: RWS) -> None:
    assert client.get_exec_state() == "running"
    assert client.is_running()
    assert client.get_modules(ignore=True) == []
    assert client.get_rapid_variable("reg1", module="user") == "0"


def test_in_its_session_the_pose_is_the_mocks_to_the_last_digit(cell: RwsCell, client: RWS) -> None:
    """It has no call for a pose: its session, its headers, its certificate setting."""
    url = f"{cell.second}/rw/motionsystem/mechunits/ROB_1/robtarget?tool=tool0&wobj=wobj0&coordinate=Base"
    answer = client.session.get(url, headers=client.headers_json, verify=client.verify)
    state = answer.json()["state"][0]
    assert {name: state[name] for name in held_by(cell)} == held_by(cell)


def test_it_takes_mastership_writes_and_gives_it_back(cell: RwsCell, client: RWS) -> None:
    assert client.set_rapid_variable("reg1", 9, module="user").status_code == 204
    assert cell.world.memory.symbols["T_ROB1/user/reg1"].value == "9"
    assert cell.world.mastership.holder("rapid") is None


def test_it_stops_resets_and_starts(cell: RwsCell, client: RWS) -> None:
    assert client.reset_pp().status_code == 400  # the program runs
    assert client.stop_RAPID().status_code == 204
    assert client.reset_pp().status_code == 204
    assert client.toggle_motors(1).status_code == 204
    assert client.start_RAPID().status_code == 204
    assert cell.world.execution_state == "running"


def test_it_loads_a_module(cell: RwsCell, client: RWS) -> None:
    client.stop_RAPID()
    cell.world.volumes.files["HOME/arrs_mod.modx"] = b"MODULE arrs_mod\nENDMODULE"
    assert client.load_module().status_code == 204
    assert client.get_modules() == ["arrs_mod"]


def test_a_rule_that_is_broken_gets_the_controllers_error(cell: RwsCell, client: RWS) -> None:
    cell.does(lambda: cell.cell.inject_fault("rws-mastership-held"))
    refused = client.set_rapid_variable("reg1", 1, module="user")
    assert refused.status_code == 403
    assert '<span class="code">-1073445862</span>' in refused.text
    assert client.get_rapid_variable("nothing", module="user").json()["status"]["code"] == -1073442816
    client.headers_json = {"accept": "application/json"}
    assert client.get_exec_state().status_code == 406
